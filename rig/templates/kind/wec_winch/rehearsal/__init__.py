"""The simulated rig."""
