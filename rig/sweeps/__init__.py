"""Sweeps: campaigns and sessions simulated without a clock, loop and plant as one function."""


class InterruptedSweepError(Exception):
    """A sweep was interrupted by the user."""
