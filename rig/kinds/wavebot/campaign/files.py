"""Opening of a campaign: all its input files are read, and all their problems are reported."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from rig.config.law_settings import find_law, inherit_law, named_law
from rig.config.problems import ConfigError, Problem
from rig.config.pydantic_errors import validate
from rig.config.reference import AnyReference, RecordedReference
from rig.config.sea import AnySea, RecordedSea
from rig.config.yaml_source import SourceMap, load_mapping
from rig.kinds.wavebot.campaign.pieces import CampaignParts, valid_parts, valid_sea
from rig.kinds.wavebot.campaign.set_points import drive_setting_problems
from rig.kinds.wavebot.campaign.stability import (
    set_point_stability_problems,
    stability_problems,
)
from rig.kinds.wavebot.campaign.stator import (
    hoist_points,
    order_rows,
    spring_map_problems,
    stator_positions,
)
from rig.kinds.wavebot.config.campaign_file import CampaignFile, campaign_model
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.kinds.wavebot.config.limits_file import LimitsFile
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.laws import Law, LawError
from rig.planning.designed_sea import largest_elevation_problems
from rig.planning.elevation import Elevation, read_elevation
from rig.planning.input_files import (
    ConfigSource,
    InputFile,
    MappingLoader,
    hash_input_file,
    hash_input_files,
    load_named_source,
    sort_problems,
)
from rig.planning.point import MAX_ROWS, Point
from rig.planning.points import count_points, matrix_points
from rig.planning.reference import (
    ReferenceRecord,
    read_reference_record,
    realisation_problems,
)
from rig.planning.windows import WindowError, calibration_window, row_windows

T = TypeVar("T")

_CAMPAIGN_KEYS = ("rig", "sea", "matrix")  # a file without any of them is not a campaign at all


class Campaign(NamedTuple):
    """A campaign whose files passed all checks that need no simulated plant."""

    file: CampaignFile
    locate: SourceMap  # of the campaign file
    rig: RigFile
    rig_locate: SourceMap  # of the rig file
    limits: LimitsFile
    plant: dict[str, Any]  # merged, not validated: sim_plant validates its own parameters
    plant_locate: SourceMap  # of the plant file
    points: tuple[Point, ...]  # empty without the device
    elevation: Elevation | None  # of a recorded sea
    record: ReferenceRecord | None  # of a recorded reference
    files: tuple[InputFile, ...]  # with the files that they extend

    @property
    def law(self) -> Law:
        """The heave law."""
        return self.file.heave_law


ExtraCheck = Callable[[CampaignParts], Iterable[Problem]]
"""An additional check of a campaign's valid parts; it runs even if other parts have problems."""


def no_extra_check(parts: CampaignParts) -> tuple[Problem, ...]:
    """Return no problems: there is no additional check."""
    return ()


def open_campaign(
    path: Path,
    extra_check: ExtraCheck = no_extra_check,
    rig_path: Path | None = None,
    load: MappingLoader = load_mapping,
) -> Campaign:
    """Read and check a campaign, its rig, the rig's limits, and the syntax of its plant.

    ``extra_check`` adds problems of other packages, such as those of the simulated plant;
    ``rig_path`` replaces the rig that the campaign names; ``load`` reads the files and may change
    their values. Raises `ConfigError` with every problem of all these files.
    """
    problems: list[Problem] = []

    def attempt(step: Callable[[], T]) -> T | None:
        try:
            return step()
        except ConfigError as error:
            problems.extend(error.problems)
            return None

    top = attempt(lambda: _read_campaign(Path(path), load))
    if top is None:
        raise ConfigError(problems)
    rig_source = attempt(
        lambda: (
            load_named_source(top, ("rig",), load, RigFile.inline)
            if rig_path is None
            else ConfigSource(*load(rig_path, inline=RigFile.inline))
        )
    )
    limits_source = plant_source = None
    if rig_source is not None:
        limits_source = attempt(lambda: load_named_source(rig_source, ("limits",), load))
    owner = rig_source if top.mapping.get("plant") is None else top
    if owner is not None:
        plant_source = attempt(lambda: load_named_source(owner, ("plant",), load))

    if rig_source is not None:
        inherit_law(top.mapping, top.locate, rig_source.mapping, rig_source.locate)
    campaign = attempt(lambda: _validate_campaign(top))
    rig = limits = points = record = None
    if rig_source is not None:
        rig = attempt(lambda: validate(rig_source.mapping, rig_source.locate, RigFile))
    if limits_source is not None:
        limits = attempt(lambda: validate(limits_source.mapping, limits_source.locate, LimitsFile))
    files = [
        *hash_input_files("campaign", top, "sea"),
        *hash_input_files("rig", rig_source, "spring map"),
        *hash_input_files("limits", limits_source),
        *hash_input_files("plant", plant_source),
        *(_law_file(campaign.heave_law) if campaign is not None else ()),
    ]
    rows = 0
    if campaign is not None:
        points = attempt(lambda: _read_points(campaign, rig, top.locate))
        rows = _count_rows(campaign, points)
        problems += _campaign_problems(campaign, rows, top.locate)
        if campaign.matrix is not None and campaign.matrix.csv is not None and points:
            files.append(
                hash_input_file("matrix", points[0].locations["spring_rate"].location.path)
            )
        record = attempt(lambda: _read_record(campaign.reference, top.locate, files))
    sea = valid_sea(top)
    elevation = attempt(lambda: _read_elevation(sea, top.locate, files))
    if rig is not None and points is not None:
        outside_map = spring_map_problems(points, rig.spring)
        problems += (
            *outside_map,
            *(stability_problems(points, rig.stability) if _has_impedance_law(campaign) else ()),
            *drive_setting_problems(campaign, points, rig, top.locate),
            *(realisation_problems(campaign.reference, points, rig.rate_hz) if campaign else ()),
        )
        if campaign and points and not outside_map and rows <= MAX_ROWS:
            first = _first_point(campaign, points, rig)
            problems += set_point_stability_problems(campaign, first, rig.stability, top.locate)
    problems += extra_check(valid_parts(top, rig_source, plant_source, sea, elevation))
    if problems:
        raise ConfigError(sort_problems(problems, (top, rig_source, limits_source, plant_source)))
    assert campaign is not None
    assert rig is not None
    assert rig_source is not None
    assert limits is not None
    assert plant_source is not None
    assert points is not None
    return Campaign(
        campaign,
        top.locate,
        rig,
        rig_source.locate,
        limits,
        plant_source.mapping,
        plant_source.locate,
        points,
        elevation,
        record,
        tuple(files),
    )


def _law_file(law: Law) -> list[InputFile]:
    """Return the file of a law that is given by its path; nothing for a registered law."""
    return [InputFile("law", Path(law.path), law.sha256)] if law.is_file else []


def _read_campaign(path: Path, load: MappingLoader) -> ConfigSource:
    """Return the campaign's own file; a file of another kind is a single problem."""
    source = ConfigSource(*load(path, inline=CampaignFile.inline))
    if not any(key in source.mapping for key in _CAMPAIGN_KEYS):
        message = f"not a campaign: it has none of the keys {', '.join(_CAMPAIGN_KEYS)}"
        raise ConfigError([source.locate.problem((), None, message)])
    return source


def _read_points(
    campaign: CampaignFile, rig: RigFile | None, locate: SourceMap
) -> tuple[Point, ...] | None:
    """Return the points; None if there are too many, as building millions of them takes long."""
    if campaign.hoist is not None:
        if rig is None:
            return None
        return hoist_points(campaign.hoist, rig.spring, locate, campaign.heave_law)
    if campaign.matrix is None:
        return ()
    if count_points(campaign.matrix) > MAX_ROWS:
        return None
    law = campaign.heave_law
    return matrix_points(campaign.matrix, locate, COLUMNS, law)


def _validate_campaign(source: ConfigSource) -> CampaignFile:
    """Return a campaign with its law; a law that cannot be used is a problem at its key."""
    try:
        law = find_law(source.mapping, source.locate, COLUMNS)
    except LawError as error:
        text, key = named_law(source.mapping)
        raise ConfigError([source.locate.problem(key, text, str(error))]) from None
    return validate(source.mapping, source.locate, campaign_model(law))


def _has_impedance_law(campaign: CampaignFile | None) -> bool:
    """Return whether the stability of a row is known from its Ki; True without a campaign."""
    return campaign is None or campaign.zc_law is not None


def _count_rows(campaign: CampaignFile, points: tuple[Point, ...] | None) -> int:
    """Return the number of rows; from the lengths of the matrix if its points were not built."""
    if points is not None or campaign.matrix is None:
        return campaign.repeat * len(points or ())
    return campaign.repeat * count_points(campaign.matrix)


def _campaign_problems(campaign: CampaignFile, rows: int, locate: SourceMap) -> tuple[Problem, ...]:
    problems = [*largest_elevation_problems(campaign.sea, campaign.sea_seed, locate)]
    try:
        if campaign.device == "present":
            row_windows(campaign.sea, campaign.timing, campaign.reference, campaign.hoist)
        else:
            calibration_window(campaign.sea, campaign.timing)
    except WindowError as error:
        problems.append(locate.problem(error.key, error.value, error.message))
    if rows > MAX_ROWS:
        key = ("repeat",) if campaign.repeat > 1 else ("matrix",)
        problems.append(locate.problem(key, rows, f"{rows} rows; allowed at most {MAX_ROWS}"))
    return tuple(problems)


def _first_point(campaign: CampaignFile, points: tuple[Point, ...], rig: RigFile) -> Point:
    """Return the point of the first row."""
    positions = stator_positions(points, rig.spring)
    first, *_ = order_rows(campaign, positions)
    return points[first.point]


def _read_elevation(
    sea: AnySea | None, locate: SourceMap, files: list[InputFile]
) -> Elevation | None:
    """Return the elevation of a recorded sea, and add its file to ``files``."""
    if not isinstance(sea, RecordedSea):
        return None
    path = _existing_path(sea.file, "sea", locate)
    elevation = read_elevation(path, sea)
    files.append(hash_input_file("elevation", path))
    return elevation


def _read_record(
    reference: AnyReference, locate: SourceMap, files: list[InputFile]
) -> ReferenceRecord | None:
    """Return the samples of a recorded reference, and add its file to ``files``."""
    if not isinstance(reference, RecordedReference):
        return None
    path = _existing_path(reference.file, "reference", locate)
    record = read_reference_record(path, reference)
    files.append(hash_input_file("reference", path))
    return record


def _existing_path(name: str, section: str, locate: SourceMap) -> Path:
    """Return the path of the file in a section; a missing file is a problem at its key."""
    key = (section, "file")
    path = locate.resolve_path(key, name)
    if not path.exists():
        message = f"{name!r} does not exist; allowed a file relative to the one with this key"
        raise ConfigError([locate.problem(key, name, message)])
    return path
