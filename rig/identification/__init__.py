"""System identification of the device from runs with an open-loop reference.

`experiments` splits a run into repeat periods, `frf` computes frequency responses with confidence
bands, `impedances` names the responses, `fit` fits mass, damping and stiffness or a passive model
of higher order, `drag` estimates the hull's quadratic drag, `excitation` identifies the wave
excitation, and `families` compares amplitudes. `identify` combines these steps and `report` writes
the results.

Complex amplitudes are those of e^{+i omega t}, t on the wave clock. Forces act on the body.
"""
