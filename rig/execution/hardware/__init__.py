"""The real wires of a rig: its devices as the loop sees them, and the processes beside the loop."""
