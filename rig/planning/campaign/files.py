"""Opening a campaign: every file it stands on, every problem in them at once."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from rig.config.campaign_file import CampaignFile
from rig.config.limits_file import LimitsFile
from rig.config.problems import ConfigError, Problem
from rig.config.pydantic_errors import validate
from rig.config.reference import AnyReference, RecordedReference
from rig.config.rig_file import RigFile
from rig.config.sea import AnySea, RecordedSea
from rig.config.yaml_source import Locate, load_mapping
from rig.planning.campaign.designed_sea import too_large
from rig.planning.campaign.elevation import Elevation, read_elevation
from rig.planning.campaign.input_files import (
    Load,
    ReadFile,
    Source,
    in_order,
    named_source,
    read_file,
    read_files,
)
from rig.planning.campaign.order import turns
from rig.planning.campaign.pieces import Pieces, pieces, sea_of
from rig.planning.campaign.point import MOST_ROWS, Point
from rig.planning.campaign.points import count, hoisted, outside_map, points, stator_positions
from rig.planning.campaign.reference import Record, read_record, unplayable
from rig.planning.campaign.set_points import foreign_to_drive
from rig.planning.campaign.stability import unstable, unstable_set_point
from rig.planning.campaign.windows import WindowError, calibration, windows

T = TypeVar("T")

_OWN = ("rig", "sea", "matrix")  # keys without which a file is not even a broken campaign


class Campaign(NamedTuple):
    """A campaign whose files passed every check that needs no plant."""

    file: CampaignFile
    locate: Locate  # where each value of the campaign file stands
    rig: RigFile
    rig_locate: Locate  # where each value of the rig file stands
    limits: LimitsFile
    plant: dict[str, Any]  # merged, not validated: sim_plant knows its own parameters
    plant_locate: Locate  # where each value of the plant file stands
    points: tuple[Point, ...]  # none without the device
    elevation: Elevation | None  # of a recorded sea
    record: Record | None  # of a recorded reference
    files: tuple[ReadFile, ...]  # with those they extend


Also = Callable[[Pieces], Iterable[Problem]]
"""A further check of a campaign, made whatever else is wrong with it."""


def nothing_more(pieces: Pieces) -> tuple[Problem, ...]:
    """No further check."""
    return ()


def open_campaign(
    path: Path,
    also: Also = nothing_more,
    rig_path: Path | None = None,
    load: Load = load_mapping,
) -> Campaign:
    """Read and check a campaign, its rig, that rig's limits, and the syntax of its plant.

    ``also`` is where the simulated plant has its say, which is not known here; ``rig_path`` stands
    in for the rig that the campaign names; ``load`` reads the files, and may change what they say.
    Raises `ConfigError` with every problem of all these files.
    """
    problems: list[Problem] = []

    def attempt(step: Callable[[], T]) -> T | None:
        try:
            return step()
        except ConfigError as error:
            problems.extend(error.problems)
            return None

    top = attempt(lambda: _top(Path(path), load))
    if top is None:
        raise ConfigError(problems)
    rig_source = attempt(
        lambda: (
            named_source(top, ("rig",), load, RigFile.inline)
            if rig_path is None
            else Source(*load(rig_path, inline=RigFile.inline))
        )
    )
    limits_source = plant_source = None
    if rig_source is not None:
        limits_source = attempt(lambda: named_source(rig_source, ("limits",), load))
    owner = rig_source if top.mapping.get("plant") is None else top
    if owner is not None:
        plant_source = attempt(lambda: named_source(owner, ("plant",), load))

    campaign = attempt(lambda: validate(top.mapping, top.locate, CampaignFile))
    rig = limits = found = recorded = None
    if rig_source is not None:
        rig = attempt(lambda: validate(rig_source.mapping, rig_source.locate, RigFile))
    if limits_source is not None:
        limits = attempt(lambda: validate(limits_source.mapping, limits_source.locate, LimitsFile))
    files = [
        *read_files("campaign", top, "sea"),
        *read_files("rig", rig_source, "spring map"),
        *read_files("limits", limits_source),
        *read_files("plant", plant_source),
    ]
    rows = 0
    if campaign is not None:
        found = attempt(lambda: _points(campaign, rig, top.locate))
        rows = _rows(campaign, found)
        problems += _own_rules(campaign, rows, top.locate)
        if campaign.matrix is not None and campaign.matrix.csv is not None and found:
            files.append(read_file("matrix", found[0].at["kp"].place.path))
        recorded = attempt(lambda: _record(campaign.reference, top.locate, files))
    sea = sea_of(top)
    elevation = attempt(lambda: _elevation(sea, top.locate, files))
    if rig is not None and found is not None:
        outside = outside_map(found, rig.spring)
        problems += (
            *outside,
            *unstable(found, rig.stability),
            *foreign_to_drive(campaign, found, rig, top.locate),
            *(unplayable(campaign.reference, found, rig.rate_hz) if campaign else ()),
        )
        if campaign is not None and found and not outside and rows <= MOST_ROWS:
            first = _first(campaign, found, rig)
            problems += unstable_set_point(campaign, first, rig.stability, top.locate)
    problems += also(pieces(top, rig_source, plant_source, sea, elevation))
    if problems:
        raise ConfigError(in_order(problems, (top, rig_source, limits_source, plant_source)))
    assert campaign is not None
    assert rig is not None
    assert rig_source is not None
    assert limits is not None
    assert plant_source is not None
    assert found is not None
    return Campaign(
        campaign,
        top.locate,
        rig,
        rig_source.locate,
        limits,
        plant_source.mapping,
        plant_source.locate,
        found,
        elevation,
        recorded,
        tuple(files),
    )


def _top(path: Path, load: Load) -> Source:
    """The campaign's own file; of a file of another kind only that is said."""
    found = Source(*load(path, inline=CampaignFile.inline))
    if not any(key in found.mapping for key in _OWN):
        message = f"no campaign: it has none of {', '.join(_OWN)}"
        raise ConfigError([found.locate.problem((), None, message)])
    return found


def _points(
    campaign: CampaignFile, rig: RigFile | None, locate: Locate
) -> tuple[Point, ...] | None:
    """None where there are too many: to build millions takes its time, only to be refused."""
    if campaign.hoist is not None:
        return hoisted(campaign.hoist, rig.spring, locate) if rig is not None else None
    if campaign.matrix is None:
        return ()
    return points(campaign.matrix, locate) if count(campaign.matrix) <= MOST_ROWS else None


def _rows(campaign: CampaignFile, found: tuple[Point, ...] | None) -> int:
    """Rows asked for; from the matrix itself where its points were too many to build."""
    if found is not None or campaign.matrix is None:
        return campaign.repeat * len(found or ())
    return campaign.repeat * count(campaign.matrix)


def _own_rules(campaign: CampaignFile, rows: int, locate: Locate) -> tuple[Problem, ...]:
    problems = [*too_large(campaign.sea, campaign.sea_seed, locate)]
    try:
        if campaign.device == "present":
            windows(campaign.sea, campaign.timing, campaign.reference, campaign.hoist)
        else:
            calibration(campaign.sea, campaign.timing)
    except WindowError as error:
        problems.append(locate.problem(error.key, error.value, error.message))
    if rows > MOST_ROWS:
        key = ("repeat",) if campaign.repeat > 1 else ("matrix",)
        problems.append(locate.problem(key, rows, f"{rows} rows; allowed at most {MOST_ROWS}"))
    return tuple(problems)


def _first(campaign: CampaignFile, found: tuple[Point, ...], rig: RigFile) -> Point:
    positions = stator_positions(found, rig.spring)
    turn, *_ = turns(found, campaign.order, campaign.repeat, campaign.seed, positions)
    return found[turn.point]


def _elevation(sea: AnySea | None, locate: Locate, files: list[ReadFile]) -> Elevation | None:
    """The elevation of a recorded sea, whose file is added to ``files``."""
    if not isinstance(sea, RecordedSea):
        return None
    path = _there(sea.file, "sea", locate)
    found = read_elevation(path, sea)
    files.append(read_file("elevation", path))
    return found


def _record(reference: AnyReference, locate: Locate, files: list[ReadFile]) -> Record | None:
    """The samples of a recorded reference, whose file is added to ``files``."""
    if not isinstance(reference, RecordedReference):
        return None
    path = _there(reference.file, "reference", locate)
    found = read_record(path, reference)
    files.append(read_file("reference", path))
    return found


def _there(name: str, section: str, locate: Locate) -> Path:
    key = (section, "file")
    path = locate.file(key, name)
    if not path.exists():
        raise ConfigError([locate.problem(key, name, f"{name!r} is not there")])
    return path
