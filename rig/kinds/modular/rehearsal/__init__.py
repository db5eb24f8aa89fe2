"""The simulated plant of a modular rig and its settings."""
