"""The motor as a linear damper of the flap: what takes power out of the waves.

    T = -R v

with v the velocity of the shaft behind the coupling, filtered. The best R without a spring is the
modulus of the flap's intrinsic impedance (OSWEC thesis (University of Washington), eq. 2.2, in
which the velocity printed must be the frequency omega).

Bad input: NaN or infinity in the velocity gives a torque that is not finite, which the limits turn
into a stop.
"""

from controllers.signals import NewtonMetre, RadianPerSecond


def torque(damping: float, velocity: RadianPerSecond) -> NewtonMetre:
    """Torque of the motor on the shaft for a ``damping`` R >= 0 (N*m*s/rad)."""
    return -damping * velocity
