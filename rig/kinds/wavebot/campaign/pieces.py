"""The valid parts of a campaign's files, for the checks of other packages.

The check of the simulated plant, for example, needs plant, sea and rig. It runs even if another
key of the same files is invalid, so that all problems are reported at once.
"""

from typing import NamedTuple, TypeVar

from pydantic import TypeAdapter, ValidationError

from rig.config.axis import Axis
from rig.config.rig_file import Rate
from rig.config.sea import AnySea, Sea
from rig.planning.elevation import Elevation
from rig.planning.input_files import ConfigSource

T = TypeVar("T")

_SEA: TypeAdapter[AnySea] = TypeAdapter(Sea)
_RATE: TypeAdapter[int] = TypeAdapter(Rate)
_HEAVE: TypeAdapter[Axis] = TypeAdapter(Axis)


class CampaignParts(NamedTuple):
    """Parts of a campaign; None for a missing or invalid part, which validation reports."""

    campaign: ConfigSource
    rig: ConfigSource | None
    plant: ConfigSource | None
    sea: AnySea | None
    elevation: Elevation | None  # of a recorded sea
    rate_hz: int | None
    heave: Axis | None


def valid_sea(campaign: ConfigSource) -> AnySea | None:
    """Return the sea of a campaign file; None if it is invalid."""
    return _validate_key(campaign, "sea", _SEA)


def valid_parts(
    campaign: ConfigSource,
    rig: ConfigSource | None,
    plant: ConfigSource | None,
    sea: AnySea | None,
    elevation: Elevation | None,
) -> CampaignParts:
    """Return the valid parts of a campaign's files."""
    rate, heave = _validate_key(rig, "rate_hz", _RATE), _validate_key(rig, "heave", _HEAVE)
    return CampaignParts(campaign, rig, plant, sea, elevation, rate, heave)


def _validate_key(source: ConfigSource | None, key: str, kind: TypeAdapter[T]) -> T | None:
    if source is None:
        return None
    try:
        return kind.validate_python(source.mapping.get(key), strict=True)
    except ValidationError:
        return None
