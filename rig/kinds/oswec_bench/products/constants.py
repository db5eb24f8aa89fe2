"""The calibration file of a session: its results, for rig files and later sessions to refer to."""

import math
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.points import SessionRun
from rig.kinds.oswec_bench.products.result import Result
from rig.regular_file import MAX_CONFIG_BYTES, read_regular

FILE = "calibration.yaml"
_DIGITS = 9


def write_constants(result: Result, session: SessionRun, folder: Path) -> list[Path]:
    """Write ``calibration.yaml``: value, unit and 95 % half width of each constant, date, run,
    method.

    Constants without an interval are left out, since nothing may be based on them. No file is
    written if a session gives no constants and no maps. Return the paths written.
    """
    constants = {
        name: {
            "value": _round_numbers(each.value),
            "unit": each.unit,
            "uncertainty": _round_numbers(each.uncertainty),
            "method": each.method,
        }
        for name, each in result.constants.items()
        if math.isfinite(each.value) and math.isfinite(each.uncertainty)
    }
    if not constants and not result.maps:
        return []
    metadata = session.metadata
    document: dict[str, Any] = {
        "name": session.kind,
        "rig": str((metadata.config.get("rig") or {}).get("name") or "not recorded"),
        "run": metadata.run,
        "date": metadata.started_utc[:10] or "1970-01-01",
        "constants": constants,
        **{key: _round_numbers(value) for key, value in result.maps.items()},
    }
    yaml = YAML()
    yaml.width = 400  # one constant per line
    path = folder / FILE
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(_flow_style(document), file)
    return [path]


def read_constant(run: Path, name: str) -> Estimate:
    """Return a constant from the calibration file of an analysed run.

    Raises ValueError if there is no such file or no constant of that name.
    """
    path = run / FILE
    if not path.is_file():
        raise ValueError(f"{run}: no {FILE}; analyse that run first")
    constants = YAML(typ="safe").load(read_regular(path, MAX_CONFIG_BYTES).decode())["constants"]
    entry = (constants or {}).get(name)
    if entry is None:
        raise ValueError(f"{path}: no {name}")
    method = f"of run {run.name}"
    return Estimate(float(entry["value"]), float(entry["uncertainty"]), entry["unit"], method)


def _round_numbers(value: Any) -> Any:
    """Return a value with its numbers rounded to the significant digits, at any depth."""
    if isinstance(value, dict):
        return {key: _round_numbers(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_round_numbers(each) for each in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def _flow_style(value: Any) -> Any:
    """Return a value for YAML; mappings of plain values and lists of numbers take one line each."""
    if isinstance(value, dict):
        mapping = CommentedMap({key: _flow_style(each) for key, each in value.items()})
        if not any(isinstance(each, dict | list) for each in value.values()):
            mapping.fa.set_flow_style()
        return mapping
    if isinstance(value, list):
        row = CommentedSeq([_flow_style(each) for each in value])
        if all(isinstance(each, float | int) for each in value):
            row.fa.set_flow_style()
        return row
    return value
