"""The identified twin: a plant file from measured runs, for rehearsals, checks and sweeps.

`records` reads lines and power of the runs, `hull`, `drivetrain` and `seas` each estimate one part
of the device with its uncertainty, `estimate` combines them, and `plant_file` writes the plant with
the source of every number. Parameters that no run determines come from the template, the plant file
that replaced the hardware, and keep their source.
"""
