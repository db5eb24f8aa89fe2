"""Recommendation of the next gain matrix from measured runs.

`trial` predicts set points on the identified twin, `search` finds the best one for each station and
law, `uncertainty` computes confidence intervals, `matrix` chooses the rows and writes them as a
campaign, `report` and `picture` write the results. This package uses only the identified twin, not
the simulated plant that replaces the hardware.
"""
