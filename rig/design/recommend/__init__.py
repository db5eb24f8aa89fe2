"""Which gains to try next: from what runs have measured to the next gain matrix.

`trial` predicts set points on the identified twin, `search` finds the best of them for each station
and law, `doubt` says how surely, `matrix` chooses the rows and writes them as a campaign, `report`
and `pictures` tell it. Nothing here knows the plant that stands in for the hardware.
"""
