"""The simulated rig, other side of the wire: written from manuals, imports nothing of ours."""
