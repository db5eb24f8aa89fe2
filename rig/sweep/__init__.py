"""Campaigns without a clock: loop and plant as one compiled function."""


class InterruptedSweepError(Exception):
    """Somebody asked to stop."""
