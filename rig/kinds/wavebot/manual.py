"""Manual mode of the WaveBot, with the set points of its campaigns."""

from functools import partial

from rig.campaign import manual
from rig.kinds.wavebot.campaign import CAMPAIGNS

write_task = partial(manual.write_task, CAMPAIGNS)
live_columns = manual.live_columns
