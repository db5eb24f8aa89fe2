"""The products of a WaveBot's run: those of any campaign, or the spring map of a hoist campaign."""

from collections.abc import Sequence
from pathlib import Path

import xarray

from rig.analysis import report
from rig.analysis.rows import MEAN_POSITION_ALARM, write_rows
from rig.analysis.summary import Summary, write_texts
from rig.kinds.wavebot.spring_map import result
from rig.kinds.wavebot.spring_map.files import write_map
from rig.kinds.wavebot.spring_map.pictures import write_pictures
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs import RunError
from rig.recording.runs.folder import run_info

SPRING_MAP = "Magnetic spring, moved by a hoist"


def summarise_run(
    run: Path,
    mean_position_alarm: float = MEAN_POSITION_ALARM,
    calibrations: Sequence[CalibrationVersion] = (),
    *,
    incomplete_rows: bool = False,
) -> Summary:
    """Return the summary of a run, as `rig.analysis.report.summarise_run`; also of a hoist's."""
    if not _is_hoisted(run, calibrations):
        return report.summarise_run(
            run, mean_position_alarm, calibrations, incomplete_rows=incomplete_rows
        )
    return _summarise_map(run, mean_position_alarm, incomplete_rows)[2]


def write_products(
    run: Path,
    mean_position_alarm: float = MEAN_POSITION_ALARM,
    calibrations: Sequence[CalibrationVersion] = (),
    *,
    incomplete_rows: bool = False,
) -> list[Path]:
    """Write the products of a run, as `rig.analysis.report.write_products`; return the files.

    A run with a hoist gives a spring map instead of surfaces.
    """
    if not _is_hoisted(run, calibrations):
        return report.write_products(
            run, mean_position_alarm, calibrations, incomplete_rows=incomplete_rows
        )
    folder = run if run.is_dir() else run.parent
    table, spring_map, summary = _summarise_map(run, mean_position_alarm, incomplete_rows)
    paths = write_rows(table, folder)
    if spring_map is not None:
        paths += [*write_map(spring_map, folder), *write_pictures(spring_map, folder)]
    return [*paths, *write_texts(summary, folder)]


def _is_hoisted(run: Path, calibrations: Sequence[CalibrationVersion]) -> bool:
    """Return whether a hoist moved the body; ValueError with calibrations, which it yields."""
    hoisted = result.is_hoisted(run_info(run).plan)
    if hoisted and calibrations:
        raise ValueError(
            "a spring map is a source of calibrations; analyse it without --calibration"
        )
    return hoisted


def _summarise_map(
    run: Path, mean_position_alarm: float, incomplete_rows: bool
) -> tuple[xarray.Dataset, xarray.Dataset | None, Summary]:
    """Return row table, spring map and summary; no map if no stator position was completed."""
    table, summary = report.summarise_rows(run, mean_position_alarm, (), incomplete_rows)
    try:
        spring_map = result.spring_map(run, incomplete_rows=incomplete_rows)
        findings = result.findings(spring_map)
    except RunError as error:
        spring_map, findings = None, [str(error)]
    summary = summary._replace(
        optima=(), effects=(), findings_of=SPRING_MAP, findings=tuple(findings)
    )
    return table, spring_map, summary
