"""The loop of a test rig and everything around it."""
