"""The wires of a modular rig: there are none yet."""
