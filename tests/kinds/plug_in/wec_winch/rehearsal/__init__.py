"""The simulated winch."""
