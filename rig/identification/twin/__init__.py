"""The identified twin: a plant file of what runs have measured, for rehearsals, checks and sweeps.

`records` cuts runs into lines and power, `hull`, `drivetrain`, `electrics` and `seas` each estimate
one part of the device with its uncertainty, `estimate` puts them together, `plant_file` writes the
plant with the source of every number. What no run can tell is taken from the plant file that stood
in for the hardware, and is named.
"""
