"""Manual mode of a modular rig, with the set points of its campaigns."""

from functools import partial

from rig.campaign import manual
from rig.kinds.modular.campaign import CAMPAIGNS

write_task = partial(manual.write_task, CAMPAIGNS)
live_columns = manual.live_columns
