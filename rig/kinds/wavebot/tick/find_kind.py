"""The WaveBot with the law that another process requests."""

from rig import laws
from rig.kinds.wavebot.tick.cycle import KIND, kind_with_law
from rig.realtime import cycle


def find_kind(law: str) -> cycle.Kind:
    """Return the WaveBot with the law of a request (`rig.laws.to_request`), empty for impedance.

    Raises LawError if the law's file is not that of the request.
    """
    return KIND if not law else kind_with_law(laws.from_request(law).module)
