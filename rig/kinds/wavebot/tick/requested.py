"""The WaveBot with the law that another process requests."""

from rig import laws
from rig.kinds.wavebot.tick.cycle import KIND, kind_with_law
from rig.realtime import cycle


def find_kind(request: str) -> cycle.Kind:
    """Return the WaveBot with a requested law, impedance for an empty text.

    Raises LawError if the law's file is not that of the request.
    """
    return KIND if not request else kind_with_law(laws.from_request(request).module)
