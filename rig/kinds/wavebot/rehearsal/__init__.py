"""Rehearsals: the loop with the simulated plant in place of the hardware.

This is one of the few packages that import sim_plant. `rig.kinds.wavebot.rehearsal.job` is the
supervisor's side, `python -m rig.kinds.wavebot.rehearsal` the loop process, and
`rig.kinds.wavebot.rehearsal.devices` translates between the signals of plant and loop.
"""
