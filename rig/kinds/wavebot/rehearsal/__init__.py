"""The simulated WaveBot: in the loop's process, and as emulated devices on its wires.

`job` is the supervisor's side of a rehearsal. The loop process connects to `devices`, which
translates between the signals of plant and loop. `emulation` is the process of the emulated
devices.
"""
