"""Rehearsals: the loop with the simulated plant in place of the hardware.

One of the few doors to sim_plant. `rig.execution.rehearsal.job` is the supervisor's side,
`python -m rig.execution.rehearsal` the loop process, `rig.execution.rehearsal.devices` translates
the plant's words.
"""
