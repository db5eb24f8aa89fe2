"""Map of the magnetic spring, from a run in which a hoist moved the body through its travel.

The map contains torque and stator force over rotor angle and stator position, the spring rate and
natural frequency of each stator position, and the reversal of the stator force (MASK4 report
(Sandia), 3.2.1.1 and 4.1). ``passes`` reduces one stator position ("station"), ``result`` builds
the map of all stations, ``files`` and ``pictures`` write it.
"""
