"""A rig of standard parts: axes, sensors and power stations as its rig file lists them."""
