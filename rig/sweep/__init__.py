"""Campaigns without a clock: loop and plant as one compiled function."""


class InterruptedWalkError(Exception):
    """Somebody asked to stop."""
