"""The code of a tick that all rigs share: loop, cycle, axis, limits, safety machine, sequence."""
