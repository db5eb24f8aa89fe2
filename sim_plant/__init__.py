"""The simulated rig on the far side of the wires.

It is written from manuals and imports no other package of this repository.
"""
