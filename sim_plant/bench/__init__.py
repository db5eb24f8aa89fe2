"""The OSWEC bench dynamometer: servo motor, gearbox, coupling, load cell, particle brake."""
