"""The OSWEC flap in waves on the bench's driveline, whose motor is its power take-off."""
