"""Recommendation of the next gain matrix from measured runs.

`set_points` predicts set points on the identified twin with confidence intervals, `search` finds
the best one for each station and law, `recommendation` chooses the rows, `report` and `picture`
write them, as a campaign, and the results. This package uses only the identified twin, not the
simulated plant that replaces the hardware.
"""
