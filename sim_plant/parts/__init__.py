"""Parts of simulated plants: one module each, with its equation and its source. Pure."""
