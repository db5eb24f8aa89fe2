"""Output of a recommendation: campaign file, JSON and text tables."""

import json
from pathlib import Path
from typing import Any

from rig.campaign.derived_file import derived_name, derived_text
from rig.config.problems import display_path
from rig.config.yaml_source import load_mapping
from rig.kinds.wavebot.recommend.recommendation import Recommendation
from rig.kinds.wavebot.recommend.set_points import STATIONS, STROKE, SetPointPrediction
from rig.presentation.phrases import aligned
from rig.stations import Station

CAMPAIGN, NUMBERS = "recommended.yaml", "recommendation.json"
_KEYS = ("spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m")
_HEADINGS = [station.heading for station in STATIONS]


def write(recommendation: Recommendation, folder: Path, output: Path | None = None) -> list[Path]:
    """Write the campaign (to ``output`` if given) and the JSON; return both paths."""
    folder.mkdir(parents=True, exist_ok=True)
    campaign, numbers = output or folder / CAMPAIGN, folder / NUMBERS
    campaign.parent.mkdir(parents=True, exist_ok=True)
    campaign.write_text(_campaign_text(recommendation, campaign), encoding="utf-8")
    numbers.write_text(json.dumps(as_dict(recommendation), indent=1) + "\n", encoding="utf-8")
    return [campaign, numbers]


def _header(recommendation: Recommendation) -> list[str]:
    measured = len(recommendation.measured)
    known_rows = f", including {measured} rows of this sea" if measured else ", none in this sea"
    return [
        f"Written by rig recommend from {', '.join(recommendation.twin.runs)}{known_rows}.",
        f"Sea: {recommendation.campaign.file.sea.description()}. "
        f"Optimised for: {recommendation.options.station.name_in_text} power.",
        "Comment of each row: the reason for it and the prediction, with 95 % intervals;",
        "mean power in W (absorbed is negative), stroke peak to peak.",
    ]


def _power_text(prediction: SetPointPrediction) -> str:
    half_width = prediction.half_width
    powers = [
        f"{station.heading} {prediction.power(station):.1f} ± {half_width[station.name]:.1f} W"
        for station in STATIONS
    ]
    return ", ".join(
        [*powers, f"stroke {prediction.values.stroke:.3f} ± {half_width[STROKE]:.3f} m"]
    )


def as_dict(recommendation: Recommendation) -> dict[str, Any]:
    """Return the recommendation as JSON values in SI units."""
    return {
        "runs": list(recommendation.twin.runs),
        "campaign": display_path(recommendation.base),
        "sea": recommendation.campaign.file.sea.description(),
        "station": recommendation.options.station.name,
        "best": _prediction_as_dict(recommendation.best._replace(half_width={})),
        "optima": [
            {
                "station": optimum.station.name,
                "law": optimum.law,
                "at_limit": optimum.at_limit,
                **_prediction_as_dict(optimum.best),
            }
            for optimum in recommendation.optima
        ],
        "rows": [
            {"why": row.reason, **_prediction_as_dict(row.prediction)}
            for row in recommendation.rows
        ],
        "measured": [
            {
                "row": comparison.row_label,
                **comparison.gains._asdict(),
                "measured": comparison.measured,
                "predicted": comparison.predicted,
            }
            for comparison in recommendation.measured
        ],
        "notes": list(recommendation.twin.notes),
    }


def _prediction_as_dict(prediction: SetPointPrediction) -> dict[str, Any]:
    entry: dict[str, Any] = prediction.gains._asdict()
    entry |= {f"power_{station.name}_w": prediction.power(station) for station in STATIONS}
    entry |= {"stroke_m": prediction.values.stroke, "current_rms_a": prediction.values.current_rms}
    if prediction.half_width:
        entry["half_width_95"] = dict(prediction.half_width)
    return entry


def as_text(recommendation: Recommendation) -> str:
    """Return a text report: optima, rows, and measured rows against their prediction."""
    lines = [
        *_header(recommendation)[:2],
        "",
        "Best by station and law",
        *_optima_lines(recommendation),
    ]
    station = recommendation.options.station
    rows: list[tuple[str, ...]] = [("spring", "Kp", "Ki", *_HEADINGS, "±", "stroke m", "reason")]
    rows += [(*_cells(row.prediction, station), row.reason) for row in recommendation.rows]
    lines += [
        "",
        f"Rows of the next campaign (± of {station.heading}, 95 %)",
        *aligned(rows, _is_number),
    ]
    if recommendation.measured:
        lines += [
            "",
            "Measured minus predicted power of rows in this sea, W",
            *_comparison_lines(recommendation),
        ]
    lines += ["", *(f"!! {note}" for note in recommendation.twin.notes)]
    return "\n".join(lines)


def _optima_lines(recommendation: Recommendation) -> list[str]:
    powers = (f"{heading} W" for heading in _HEADINGS)
    gains = ("spring N/m", "Kp N·s/m", "Ki N/m")
    rows: list[tuple[str, ...]] = [("for", "law", *gains, *powers, "±", "x stroke m", "")]
    for optimum in recommendation.optima:
        name, at_limit = f"{optimum.station.name_in_text} power", optimum.at_limit
        cells = _cells(optimum.best, optimum.station)
        rows.append((name, optimum.law, *cells, "at a limit" if at_limit else ""))
    return aligned(rows, _is_number)


def _comparison_lines(recommendation: Recommendation) -> list[str]:
    lines: list[tuple[str, ...]] = []
    for station in STATIONS:
        errors = [
            comparison.measured[station.name] - comparison.predicted[station.name]
            for comparison in recommendation.measured
        ]
        mean = sum(errors) / len(errors)
        worst = max(errors, key=abs)
        lines.append((station.heading, f"mean {mean:+.2f}", f"worst {worst:+.2f}"))
    return aligned(lines, _is_number)


def _cells(one: SetPointPrediction, station: Station) -> tuple[str, ...]:
    """Return gains, powers, the interval of a station's power, and stroke."""
    kp, ki, spring_rate = one.gains
    return (
        *(f"{each:.0f}" for each in (spring_rate, kp, ki)),
        *(f"{one.power(each):.1f}" for each in STATIONS),
        f"{one.half_width[station.name]:.1f}",
        f"{one.values.stroke:.3f}",
    )


def _is_number(column: int, cell: str) -> bool:
    return cell.replace("-", "").replace("+", "").replace(".", "").isdigit()


def _campaign_text(recommendation: Recommendation, path: Path) -> str:
    """Return the text of the file at ``path``: the base campaign with the recommended matrix."""
    base, file = recommendation.base, recommendation.campaign.file
    mapping, _ = load_mapping(base, inline=("sea", "tank"))
    others = _other_columns(mapping.get("matrix") or {})
    rows = []
    for row in recommendation.rows:
        kp, ki, spring_rate = row.prediction.gains
        values = dict(zip(_KEYS, (spring_rate, kp, ki), strict=True)) | others
        rows.append((values, f"{row.reason}: {_power_text(row.prediction)}"))
    keys = (
        f"name: {derived_name(file.name, '_recommended')}",
        "repeat: 1",
        "order: fewest spring moves",
    )
    return derived_text(base, path, _header(recommendation), keys, rows)


def _other_columns(inherited: dict[str, Any]) -> dict[str, float]:
    """Return the columns other than gains and spring, with the values of the base's first row."""
    rows = inherited.get("list") or inherited.get("grid") or [{}]
    columns: dict[str, float] = {}
    for key, value in rows[0].items():
        if key in _KEYS:
            continue
        first = value["from"] if isinstance(value, dict) else value
        columns[key] = float(first[0] if isinstance(first, list) else first)
    return columns
