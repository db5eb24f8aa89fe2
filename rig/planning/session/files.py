"""Opening a session of the bench: every file it stands on, every problem in them at once."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from rig.config.bench_limits_file import BenchLimitsFile
from rig.config.bench_rig_file import BenchRigFile
from rig.config.constants_file import ConstantsFile
from rig.config.problems import ConfigError, Problem
from rig.config.pydantic_errors import validate
from rig.config.session_file import SESSION_COLUMNS, SessionFile
from rig.config.yaml_source import KeyPath, SourceMap, load_mapping
from rig.planning.campaign.input_files import (
    ConfigSource,
    InputFile,
    hash_input_files,
    load_named_source,
    sort_problems,
)
from rig.planning.session.constants import Constants, gathered
from rig.planning.session.correction import Correction, correction
from rig.planning.session.flume import repeats_in_ticks
from rig.planning.session.rows import MOST_ROWS, SessionPoint, count, points

T = TypeVar("T")


class Pieces(NamedTuple):
    """What of a session is there for further checks; None for what is missing or wrong."""

    session: ConfigSource
    rig: ConfigSource | None
    plant: ConfigSource | None
    rig_file: BenchRigFile | None
    file: SessionFile | None


class Session(NamedTuple):
    """A session whose files passed every check that needs no plant."""

    file: SessionFile
    locate: SourceMap  # where each value of the session file stands
    rig: BenchRigFile
    limits: BenchLimitsFile
    plant: dict[str, Any]  # merged, not validated: sim_plant knows its own parameters
    plant_locate: SourceMap
    points: tuple[SessionPoint, ...]
    constants: Constants
    correction: Correction
    files: tuple[InputFile, ...]  # with those they extend


Also = Callable[[Pieces], Iterable[Problem]]
"""A further check of a session, made whatever else is wrong with it."""


def nothing_more(pieces: Pieces) -> tuple[Problem, ...]:
    """No further check."""
    return ()


def is_session(path: Path) -> bool:
    """Whether a file is one of a session, and not of a campaign; False for one nobody can read."""
    try:
        mapping, _ = load_mapping(Path(path))
    except ConfigError:
        return False
    return "session" in mapping


class _Opening:
    """Reads file after file and keeps what is wrong with each."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self.sources: list[ConfigSource | None] = []
        self.files: list[InputFile] = []

    def attempt(self, step: Callable[[], T]) -> T | None:
        """What a step gives, or None where it found problems."""
        try:
            return step()
        except ConfigError as error:
            self.problems.extend(error.problems)
            return None

    def read(
        self, role: str, owner: ConfigSource | None, key: KeyPath, instead: Path | None = None
    ) -> ConfigSource | None:
        """The file named at a key of another, or ``instead``."""
        if owner is None:
            return None
        source = self.attempt(
            lambda: (
                load_named_source(owner, key)
                if instead is None
                else ConfigSource(*load_mapping(instead))
            )
        )
        self.sources.append(source)
        self.files += hash_input_files(role, source)
        return source

    def model(self, source: ConfigSource | None, model: type[T]) -> T | None:
        """A source as its model."""
        if source is None:
            return None
        return self.attempt(lambda: validate(source.mapping, source.locate, model))  # type: ignore[type-var]

    def constants(self, owner: ConfigSource | None, key: KeyPath) -> ConstantsFile | None:
        """The file of constants named at a key."""
        return self.model(self.read("calibration", owner, key), ConstantsFile)

    def calibrations(self, owner: ConfigSource | None) -> list[ConstantsFile]:
        """Every file that is named under `calibrations`."""
        named = owner.mapping.get("calibrations") if owner is not None else None
        keys = range(len(named)) if isinstance(named, list) else ()
        found = [self.constants(owner, ("calibrations", i)) for i in keys]
        return [one for one in found if one is not None]


def open_session(path: Path, also: Also = nothing_more, rig_path: Path | None = None) -> Session:
    """Read and check a session, its rig, that rig's limits, and the calibrations of both.

    ``also`` is where the simulated plant has its say; ``rig_path`` stands in for the rig that the
    session names. Raises `ConfigError` with every problem of all these files.
    """
    opening = _Opening()
    top = ConfigSource(*load_mapping(Path(path)))
    opening.sources.append(top)
    opening.files += hash_input_files("session", top)
    rig_source = opening.read("rig", top, ("rig",), rig_path)
    limits = opening.model(opening.read("limits", rig_source, ("limits",)), BenchLimitsFile)
    owner = top if top.mapping.get("plant") is not None else rig_source
    plant = opening.read("plant", owner, ("plant",))
    file, rig = opening.model(top, SessionFile), opening.model(rig_source, BenchRigFile)
    measured = [*opening.calibrations(top), *opening.calibrations(rig_source)]
    used = {
        name: opening.constants(top, ("correction", name))
        for name in ("regressions", "conditions", "map")
    }
    found: tuple[SessionPoint, ...] = ()
    corrected: Correction | None = None
    if file is not None:
        rows = file.repeat * count(file)
        if rows > MOST_ROWS:
            message = f"{rows} rows; allowed at most {MOST_ROWS}"
            key = "repeat" if file.repeat > 1 else "grid"
            opening.problems.append(top.locate.problem((key,), rows, message))
        else:
            found = points(file, top.locate)
    if file is not None and not opening.problems:
        corrected = opening.attempt(lambda: correction(file, found, used, top.locate))
        if rig is not None and limits is not None:
            opening.problems += _beyond(found, rig, limits)
            opening.problems += repeats_in_ticks(file, found, float(rig.rate_hz))
    opening.problems += also(Pieces(top, rig_source, plant, rig, file))
    if opening.problems:
        raise ConfigError(sort_problems(opening.problems, opening.sources))
    assert file is not None
    assert rig is not None
    assert limits is not None
    assert plant is not None
    assert corrected is not None
    return Session(
        file,
        top.locate,
        rig,
        limits,
        plant.mapping,
        plant.locate,
        found,
        gathered(rig, file, [*(one for one in used.values() if one is not None), *measured]),
        corrected,
        tuple(opening.files),
    )


def _beyond(
    found: tuple[SessionPoint, ...], rig: BenchRigFile, limits: BenchLimitsFile
) -> list[Problem]:
    """Set points that the limits would never grant."""
    most = {
        "amplitude": limits.motor.angle_stop_deg,
        "release": limits.shaft.slip_stop_deg,
        "torque_amplitude": limits.load_cell.twisting_stop_n_m,
        "current_amplitude": limits.motor.current_peak_a,
        "brake_current": rig.brake.map[-1].current_a,
    }
    units = {column.name: column.unit for column in SESSION_COLUMNS}
    problems: dict[tuple[str, int], Problem] = {}
    for point in found:
        for name, bound in most.items():
            value = point.given.get(name, 0.0)
            strict = name in ("amplitude", "torque_amplitude", "release")
            if abs(value) > bound or (strict and abs(value) == bound):
                told = "below" if strict else "up to"
                message = (
                    f"{value:g} is more than limits and rig allow; allowed {told} {bound:g} "
                    f"{units[name]}"
                )
                problem = point.at[name].problem(value, message)
                problems.setdefault((problem.key, problem.line), problem)
    return list(problems.values())
