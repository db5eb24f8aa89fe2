"""Opening of a campaign: all its input files are read, and all their problems are reported."""

import re
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from rig.campaign.assessed import assessment_problems
from rig.campaign.kind import AnyCampaign, Campaign, CampaignKind
from rig.campaign.plan import build_plan
from rig.campaign.set_points import chosen_law_problems
from rig.config.campaign_file import BaseCampaignFile
from rig.config.problems import ConfigError, Problem
from rig.config.pydantic_errors import validate
from rig.config.reference import AnyReference, RecordedReference
from rig.config.rig_file import BaseRigFile, PowerRigFile, Rate
from rig.config.sea import AnySea, RecordedSea, Sea
from rig.config.yaml_source import SourceMap, load_mapping
from rig.planning.designed_sea import largest_elevation_problems
from rig.planning.elevation import Elevation, read_elevation
from rig.planning.input_files import (
    ConfigSource,
    FileReader,
    InputFile,
    MappingLoader,
    hash_input_file,
)
from rig.planning.point import MAX_ROWS, Point
from rig.planning.points import count_points
from rig.planning.reference import ReferenceRecord, read_reference_record, realisation_problems
from rig.planning.windows import WindowError

T = TypeVar("T")

_SEA: TypeAdapter[AnySea] = TypeAdapter(Sea)
_RATE: TypeAdapter[int] = TypeAdapter(Rate)
PREDICTION = "the prediction of each row"
_ROWS = "the rows of the matrix against rig and law"
_PLAN = "the plan of the rows, with one tick of the law for each"
_WIRES = "the wires of the rig"
CAMPAIGN_KEYS = ("rig", "sea", "matrix")  # a file without any of them is not a campaign at all


_DEPENDENT_KEYS = {"law", "matrix", "rig", "plant", "reference"}  # on the kind of rig, or the law


class CampaignParts(NamedTuple):
    """The valid parts of a campaign's files, for the checks of other packages.

    The check of the simulated plant, for example, needs plant, sea and rig. It runs even if another
    key of the same files is invalid, so that all problems are reported at once. A missing or
    invalid part, which validation reports, is None.
    """

    campaign: ConfigSource
    model: type[BaseCampaignFile] | None  # with the campaign's laws
    rig: ConfigSource | None
    plant: ConfigSource | None
    sea: AnySea | None
    elevation: Elevation | None  # of a recorded sea
    rate_hz: int | None


def valid_key(source: ConfigSource | None, key: str, kind: TypeAdapter[T]) -> T | None:
    """Return the value of a key of a file; None if it is invalid."""
    if source is None:
        return None
    try:
        return kind.validate_python(source.mapping.get(key), strict=True)
    except ValidationError:
        return None


ExtraCheck = Callable[[CampaignParts], Iterable[Problem]]
"""An additional check of a campaign's valid parts; it runs even if other parts have problems."""


def no_extra_check(parts: CampaignParts) -> tuple[Problem, ...]:
    """Return no problems: there is no additional check."""
    return ()


def open_campaign(
    kind: CampaignKind,
    path: Path,
    extra_check: ExtraCheck = no_extra_check,
    rig_path: Path | None = None,
    load: MappingLoader = load_mapping,
) -> AnyCampaign:
    """Read and check a campaign, its rig, the rig's limits, and the syntax of its plant.

    ``extra_check`` adds problems of other packages, such as those of the simulated plant;
    ``rig_path`` replaces the rig that the campaign names; ``load`` reads the files and may change
    their values. Raises `ConfigError` with every problem of all these files.
    """
    reader = FileReader(load)
    problems, files, attempt = reader.problems, reader.files, reader.attempt
    top = reader.read_first("campaign", Path(path), kind.campaign_file.inline)
    _require_campaign(top)
    rig_source = reader.read("rig", top, ("rig",), rig_path, kind.rig_file.inline)
    limits_source = reader.read("limits", rig_source, ("limits",))
    owner = rig_source if top.mapping.get("plant") is None else top
    plant_source = reader.read("plant", owner, ("plant",))
    laws = attempt(lambda: kind.find_laws(top, rig_source))
    if laws is None:  # the law decides about the columns of the matrix
        problems += common_problems(top, [kind.campaign_file])
        reader.unchecked.append("the matrix and the other keys that depend on the law")
    model = None if laws is None else kind.model(laws, rig_source.mapping if rig_source else {})
    file = None if model is None else reader.validated(top, model)
    rig = reader.validated(rig_source, kind.rig_file)
    limits = reader.validated(limits_source, kind.limits_file)
    points = record = None
    if file is not None:
        files += _law_files(file)
        points = attempt(lambda: kind.points(file, rig, top.locate))
        problems += _campaign_problems(kind, file, points, top.locate)
        if file.matrix is not None and file.matrix.csv is not None and points:
            location = next(iter(points[0].locations.values())).location
            files.append(hash_input_file("matrix", location.path))
        record = attempt(lambda: _read_record(file.reference, top.locate, files))
    sea = valid_key(top, "sea", _SEA)
    elevation = attempt(lambda: _read_elevation(sea, top.locate, files))
    if rig is not None and points is not None:
        if file is not None:
            problems += chosen_law_problems(file, points, top.locate)
        problems += kind.point_problems(file, rig, points, top.locate)
        if file is not None:
            problems += assessment_problems(kind, file, rig, points, top.locate)
            problems += realisation_problems(file.reference, points, rig.rate_hz)
    if rig is not None and rig_source is not None:
        problems += _budget_problems(rig, kind.signals(rig), rig_source.locate)
    rate_hz = valid_key(rig_source, "rate_hz", _RATE)
    problems += extra_check(
        CampaignParts(top, model, rig_source, plant_source, sea, elevation, rate_hz)
    )
    rows = () if rig is not None and points is not None and file is not None else (_ROWS,)
    reader.raise_problems(*rows, _PLAN, PREDICTION, *later_checks(rig))
    assert file is not None
    assert points is not None
    assert rig_source is not None
    assert plant_source is not None
    campaign: AnyCampaign = Campaign(
        kind,
        file,
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
        file.seeds[0],
    )
    _require_windows(campaign)
    return campaign


def _law_files(file: BaseCampaignFile) -> list[InputFile]:
    """Return the files of the laws of a campaign, without those of packages."""
    used = dict.fromkeys(law for each in file.axis_laws.values() for law in each.law.members)
    return [InputFile("law", Path(law.path), law.sha256) for law in used if law.is_file]


def _require_windows(campaign: AnyCampaign) -> None:
    """Raise a problem if waves reflected in the tank leave no window for a row."""
    try:
        if campaign.file.tank is not None:
            build_plan(campaign)
    except WindowError as error:  # by the reflection; the windows alone fit
        problem = campaign.locate.problem(error.key, error.value, error.message)
        raise ConfigError([problem], [PREDICTION, *later_checks(campaign.rig)]) from error


def later_checks(rig: BaseRigFile | None) -> tuple[str, ...]:
    """Return the checks that follow those of the campaign: of the wires, unless there are none."""
    return () if rig is not None and rig.wiring is None else (_WIRES,)


def common_problems(source: ConfigSource, models: Iterable[type[BaseModel]]) -> list[Problem]:
    """Return the problems at keys of all campaigns that are the same with each of several models.

    A campaign whose rig or law cannot be read has more keys; those depend on rig and law.
    """
    common = BaseCampaignFile.model_fields.keys() - _DEPENDENT_KEYS
    found: list[tuple[Problem, ...]] = []
    for model in models:
        try:
            validate(source.mapping, source.locate, model)
        except ConfigError as error:
            found.append(error.problems)
        else:
            found.append(())
    return [
        problem
        for problem in (found[0] if found else ())
        if re.split(r"[.\[]", problem.key)[0] in common
        and all(problem in others for others in found)
    ]


def _require_campaign(source: ConfigSource) -> None:
    """Raise a single problem for a file that is no campaign."""
    if not any(key in source.mapping for key in CAMPAIGN_KEYS):
        message = f"not a campaign: it has none of the keys {', '.join(CAMPAIGN_KEYS)}"
        raise ConfigError([source.locate.problem((), None, message)])


def _budget_problems(
    rig: BaseRigFile, signals: Collection[str], locate: SourceMap
) -> Iterator[Problem]:
    """Yield the names in a rig's uncertainty budget that are no signals of its power stations."""
    budget = rig.uncertainty if isinstance(rig, PowerRigFile) else None
    for i, source in enumerate(budget.sources if budget else ()):
        for j, name in enumerate(source.signals):
            if name not in signals:
                allowed = ", ".join(signals) or "none: this kind of rig has no power stations"
                message = f"{name!r} is no signal of a power station; allowed {allowed}"
                key = ("uncertainty", "sources", i, "signals", j)
                yield locate.problem(key, name, message)


def _campaign_problems(
    kind: CampaignKind,
    file: BaseCampaignFile,
    points: tuple[Point, ...] | None,
    locate: SourceMap,
) -> list[Problem]:
    """Return the problems of sea, windows and number of rows."""
    problems = [
        *dict.fromkeys(
            problem
            for seed in file.seeds
            for problem in largest_elevation_problems(file.sea, file.sea_seed(seed), locate)
        )
    ]
    try:
        kind.windows(file)
    except WindowError as error:
        problems.append(locate.problem(error.key, error.value, error.message))
    matrix: Any = file.matrix
    count = len(points or ())
    if points is None and matrix is not None:  # too many to build: its lengths give their number
        count = count_points(matrix.grid, matrix.combinations)
    rows = len(file.seeds) * file.repeat * count
    if rows > MAX_ROWS:
        key = ("repeat",) if file.repeat > 1 else ("matrix",)
        problems.append(locate.problem(key, rows, f"{rows} rows; allowed at most {MAX_ROWS}"))
    return problems


def _read_elevation(
    sea: AnySea | None, locate: SourceMap, files: list[InputFile]
) -> Elevation | None:
    """Return the elevation of a recorded sea, and add its file to ``files``."""
    if not isinstance(sea, RecordedSea):
        return None
    path = locate.existing_path(("sea", "file"), sea.file)
    elevation = read_elevation(path, sea)
    files.append(hash_input_file("elevation", path))
    return elevation


def _read_record(
    reference: AnyReference, locate: SourceMap, files: list[InputFile]
) -> ReferenceRecord | None:
    """Return the samples of a recorded reference, and add its file to ``files``."""
    if not isinstance(reference, RecordedReference):
        return None
    path = locate.existing_path(("reference", "file"), reference.file)
    record = read_reference_record(path, reference)
    files.append(hash_input_file("reference", path))
    return record
