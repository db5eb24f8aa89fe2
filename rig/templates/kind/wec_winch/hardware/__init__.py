"""The real devices: there are none yet."""
