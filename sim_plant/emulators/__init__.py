"""Emulated devices at the far end of the wires, all connected to one simulated rig."""
