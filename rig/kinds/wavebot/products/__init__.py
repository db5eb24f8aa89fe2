"""Results of a WaveBot's runs: rows, power surfaces and summary of a campaign, as of every
kind with gain matrices, or the spring map of a hoist campaign; the surge damping.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rig.analysis import report
from rig.analysis.report import NO_PRODUCTS, PROGRESS, Analysis
from rig.analysis.rows import write_rows
from rig.kinds.wavebot.spring_map import result
from rig.kinds.wavebot.spring_map.files import write_map
from rig.kinds.wavebot.spring_map.pictures import write_pictures
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs import RunError, run_info

__all__ = ["NO_PRODUCTS", "PROGRESS", "after_run", "analyse", "draw", "summarise"]

SPRING_MAP = "Magnetic spring, moved by a hoist"


def analyse(
    run: Path, calibrations: Sequence[CalibrationVersion] = (), *, incomplete_rows: bool = False
) -> Analysis:
    """Return the analysis of a run, as `rig.analysis.report.analyse`.

    A run in which a hoist moved the body gives a spring map instead of surfaces, or none if no
    stator position was completed; ValueError with calibrations, which a map yields.
    """
    if not result.is_hoisted(run_info(run).plan):
        return report.analyse(run, calibrations, incomplete_rows=incomplete_rows)
    if calibrations:
        raise ValueError(
            "a spring map is a source of calibrations; analyse it without --calibration"
        )
    table, summary = report.summarise_rows(run, incomplete_rows=incomplete_rows)
    spring_map = None
    try:
        spring_map = result.spring_map(run, incomplete_rows=incomplete_rows)
        findings = result.findings(spring_map)
    except RunError as error:
        findings = [str(error)]
    summary = summary._replace(
        optima=(), effects=(), findings_of=SPRING_MAP, findings=tuple(findings)
    )

    def write(folder: Path) -> list[Path]:
        paths = write_rows(table, folder)
        if spring_map is not None:
            paths += [*write_map(spring_map, folder), *write_pictures(spring_map, folder)]
        return paths

    return Analysis(summary, write)


after_run = partial(report.after_run, analyse=analyse)
draw = partial(report.draw, analyse=analyse)
summarise = partial(report.summarise, analyse=analyse)
