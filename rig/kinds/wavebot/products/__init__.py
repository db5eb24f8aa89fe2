"""What is made of a WaveBot's runs: rows, power surfaces and summary of a campaign, as of every
kind with gain matrices, or the spring map of a hoist campaign; the surge damping.
"""

from functools import partial

from rig.analysis import campaign_products
from rig.analysis.campaign_products import NO_PRODUCTS, PROGRESS
from rig.kinds.wavebot.products.report import analyse

__all__ = ["NO_PRODUCTS", "PROGRESS", "after_run", "draw", "summarise"]

after_run = partial(campaign_products.after_run, analyse=analyse)
draw = partial(campaign_products.draw, analyse=analyse)
summarise = partial(campaign_products.summarise, analyse=analyse)
