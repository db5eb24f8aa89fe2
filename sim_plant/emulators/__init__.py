"""Emulated devices: what stands on the far end of the wires, all on one simulated rig."""
