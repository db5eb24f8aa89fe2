"""The OSWEC bench: a dynamometer for the drive of an oscillating surge converter."""
