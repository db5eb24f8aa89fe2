"""The bench's world, advanced only by advance(dt). No clock, no I/O, seeded."""

from __future__ import annotations

from sim_plant.bench import dynamometer
from sim_plant.bench.dynamometer import BenchParams, BenchState
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.signals import OFF, Actuation, BenchReading, BenchTruth
from sim_plant.bench.stepper import Stepper
from sim_plant.bench.wires import PlantInterface
from sim_plant.units import Count, Radian, Second

__all__ = ["OFF", "Actuation", "BenchReading", "BenchTruth", "BenchWorld", "Stepper"]


class BenchWorld(PlantInterface):
    """A dynamometer bench."""

    def __init__(
        self, plant: BenchPlant, *, dt: float, seed: int, stepper: type[Stepper] = Stepper
    ) -> None:
        """Build the bench at rest; arguments and errors are those of `PlantInterface`."""
        self.params = plant.build()
        start = dynamometer.initial(self.params)
        delay = plant.sensors.delay_ticks.value
        super().__init__(self.params, start, delay, dt=dt, seed=seed, stepper=stepper)
        self._slip_counts: Count = 0
        self._brake_powered = True

    def slip_coupling(self, angle: Radian) -> None:
        """Let the shaft slip in its coupling: its encoder stays ahead of the motor by `angle`."""
        self._slip_counts += round(self.params.sensors.shaft_counts * angle)

    def cut_brake_current(self, cut: bool = True) -> None:
        """Set the brake's current to 0 whatever the command, or restore it."""
        self._brake_powered = not cut

    def truth(self) -> BenchTruth:
        """Return the true state, for tests and comparison with estimates."""
        return compute_truth(self.params, self._stepper.state, self._tick * self._dt)

    def _step_plant(self) -> BenchReading:
        actuation = self._actuation
        if not self._brake_powered:
            actuation = actuation._replace(brake_current_a=0.0)
        reading = self._stepper.advance(actuation, self._fresh, self._stop_pressed, self._tick)
        if self._slip_counts:
            reading = reading._replace(shaft_counts=reading.shaft_counts + self._slip_counts)
        return reading


def compute_truth(params: BenchParams, state: BenchState, time: Second) -> BenchTruth:
    """Return the true quantities of a state."""
    return BenchTruth(
        state.motor_angle,
        state.motor_velocity,
        state.shaft_angle,
        state.shaft_velocity,
        state.shaft_torque,
        params.motor.torque_per_current * state.drive.current,
        state.friction,
        state.brake.torque,
        state.power,
        time,
    )
