"""System identification: what the device is, from runs with an open-loop reference.

From record to report: `experiments` cuts a run into repeat periods, `frf` makes frequency
responses with confidence bands, `impedances` says which responses they are, `fit` turns them into
mass, damping and stiffness or a passive model of higher order, `drag` tells the hull's quadratic
drag, `excitation` finds what the waves do, `families` what changes with amplitude; `identify` puts
it together, `report` writes it down.

Complex amplitudes are those of e^{+i omega t}, t on the wave clock. Forces are forces on the body.
"""
