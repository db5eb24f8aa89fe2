"""Campaigns without a clock: loop and plant as one compiled function."""
