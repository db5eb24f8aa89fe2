"""The magnetic spring's map from a run in which a hoist moved the body through it.

MASK4 report (Sandia), 3.2.1.1 and 4.1: torque and stator force over rotor angle and stator
position, the spring rate of each position, the natural frequency it makes, where the stator's
force reverses. ``passes`` reduces one station, ``result`` makes the map of all, ``files`` and
``pictures`` write it.
"""
