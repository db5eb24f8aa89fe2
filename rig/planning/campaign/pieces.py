"""What of a campaign is right by itself, for checks that `rig.planning.campaign` cannot make.

The simulated plant is such a check: it is told of plant, sea and rig even when another key of the
same file is wrong, so that all problems come at once.
"""

from typing import NamedTuple, TypeVar

from pydantic import TypeAdapter, ValidationError

from rig.config.rig_file import Axis, Rate
from rig.config.sea import AnySea, Sea
from rig.planning.campaign.elevation import Elevation
from rig.planning.campaign.input_files import Source

T = TypeVar("T")

_SEA: TypeAdapter[AnySea] = TypeAdapter(Sea)
_RATE: TypeAdapter[int] = TypeAdapter(Rate)
_HEAVE: TypeAdapter[Axis] = TypeAdapter(Axis)


class Pieces(NamedTuple):
    """Parts of a campaign; None for what is missing or wrong, which is told elsewhere."""

    campaign: Source
    rig: Source | None
    plant: Source | None
    sea: AnySea | None
    elevation: Elevation | None  # of a recorded sea
    rate_hz: int | None
    heave: Axis | None


def sea_of(campaign: Source) -> AnySea | None:
    """The sea of a campaign file, if it is right."""
    return _part(campaign, "sea", _SEA)


def pieces(
    campaign: Source,
    rig: Source | None,
    plant: Source | None,
    sea: AnySea | None,
    elevation: Elevation | None,
) -> Pieces:
    """The pieces of a campaign's files."""
    rate, heave = _part(rig, "rate_hz", _RATE), _part(rig, "heave", _HEAVE)
    return Pieces(campaign, rig, plant, sea, elevation, rate, heave)


def _part(source: Source | None, key: str, kind: TypeAdapter[T]) -> T | None:
    if source is None:
        return None
    try:
        return kind.validate_python(source.mapping.get(key), strict=True)
    except ValidationError:
        return None
