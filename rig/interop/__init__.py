"""Files of other laboratories and of other programs."""
