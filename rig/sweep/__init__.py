"""Sweeps: campaigns simulated without a clock, with loop and plant as one compiled function."""


class InterruptedSweepError(Exception):
    """A sweep was interrupted by the user."""
