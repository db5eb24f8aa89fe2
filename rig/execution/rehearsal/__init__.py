"""Rehearsals: the loop with the simulated plant in place of the hardware.

This is one of the few packages that import sim_plant. `rig.execution.rehearsal.job` is the
supervisor's side, `python -m rig.execution.rehearsal` the loop process, and
`rig.execution.rehearsal.devices` translates between the signals of plant and loop.
"""
