"""The calibration file of a session: what it found, for rig files and further sessions to name."""

import math
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from rig.analysis.session.estimate import Estimate
from rig.analysis.session.points import Session
from rig.analysis.session.result import Result
from rig.regular_file import MAX_CONFIG_BYTES, read_regular

FILE = "calibration.yaml"
_DIGITS = 9


def write_constants(result: Result, session: Session, folder: Path) -> list[Path]:
    """``calibration.yaml``: value, unit and 95 % half width of each constant, date, run, method.

    Constants without an interval are left out: nothing may rest on them. No file where a session
    gives nothing to calibrate by.
    """
    constants = {
        name: {
            "value": _rounded(each.value),
            "unit": each.unit,
            "uncertainty": _rounded(each.uncertainty),
            "method": each.method,
        }
        for name, each in result.constants.items()
        if math.isfinite(each.value) and math.isfinite(each.uncertainty)
    }
    if not constants and not result.maps:
        return []
    known = session.known
    told: dict[str, Any] = {
        "name": session.kind,
        "rig": str((known.config.get("rig") or {}).get("name") or "not recorded"),
        "run": known.run,
        "date": known.started_utc[:10] or "1970-01-01",
        "constants": constants,
        **{key: _rounded(value) for key, value in result.maps.items()},
    }
    yaml = YAML()
    yaml.width = 400  # a constant a line
    path = folder / FILE
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(_short(told), file)
    return [path]


def known_constant(run: Path, name: str) -> Estimate:
    """A constant that an analysed run found; ValueError if its file has none of that name."""
    path = run / FILE
    if not path.is_file():
        raise ValueError(f"{run}: no {FILE}; analyse that run first")
    constants = YAML(typ="safe").load(read_regular(path, MAX_CONFIG_BYTES).decode())["constants"]
    found = (constants or {}).get(name)
    if found is None:
        raise ValueError(f"{path}: no {name}")
    method = f"of run {run.name}"
    return Estimate(float(found["value"]), float(found["uncertainty"]), found["unit"], method)


def _rounded(value: Any) -> Any:
    """Numbers with as many digits as can mean something, at any depth."""
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(each) for each in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def _short(value: Any) -> Any:
    """Mappings of plain values and lists of numbers in one line each."""
    if isinstance(value, dict):
        made = CommentedMap({key: _short(each) for key, each in value.items()})
        if not any(isinstance(each, dict | list) for each in value.values()):
            made.fa.set_flow_style()
        return made
    if isinstance(value, list):
        row = CommentedSeq([_short(each) for each in value])
        if all(isinstance(each, float | int) for each in value):
            row.fa.set_flow_style()
        return row
    return value
