"""A recommendation written down: campaign, JSON, tables."""

import json
from pathlib import Path
from typing import Any

from rig.config.problems import display_path
from rig.design.recommend.matrix import campaign_text, words
from rig.design.recommend.recommendation import Recommendation
from rig.design.recommend.search import STATIONS
from rig.design.recommend.trial import Tried
from rig.design.recommend.uncertainty import STROKE

CAMPAIGN, NUMBERS = "recommended.yaml", "recommendation.json"
SHORT = {"mechanical_1": "mech", "ac": "AC", "dc": "DC"}


def write(advice: Recommendation, folder: Path, output: Path | None = None) -> list[Path]:
    """The campaign (at ``output`` if given) and the JSON."""
    folder.mkdir(parents=True, exist_ok=True)
    campaign, numbers = output or folder / CAMPAIGN, folder / NUMBERS
    campaign.parent.mkdir(parents=True, exist_ok=True)
    beside = [
        f"{row.why}: {_powers(row.tried, told)}"
        for row, told in zip(advice.rows, advice.intervals, strict=True)
    ]
    name = advice.campaign.file.name
    name = name if name.endswith("_recommended") else f"{name[:52]}_recommended"
    text = campaign_text(campaign, advice.base, name, _head(advice), advice.rows, beside)
    campaign.write_text(text, encoding="utf-8")
    numbers.write_text(json.dumps(as_dict(advice), indent=1) + "\n", encoding="utf-8")
    return [campaign, numbers]


def _head(advice: Recommendation) -> list[str]:
    measured = len(advice.measured)
    told = f", {measured} rows of this sea among them" if measured else ", none of them in this sea"
    return [
        f"Written by rig recommend from {', '.join(advice.twin.runs)}{told}.",
        f"Sea: {advice.campaign.file.sea.description()}. Looked for: {words(advice.asked.station)}.",
        "Behind each row: why it is there and what is predicted, with 95 % intervals;",
        "mean power in W (absorbed is negative), stroke from lowest to highest.",
    ]


def _powers(one: Tried, told: dict[str, float]) -> str:
    said = [f"{SHORT[s]} {one.power(s):.1f} ± {told[s]:.1f} W" for s in STATIONS]
    return ", ".join([*said, f"stroke {one.foreseen.stroke:.3f} ± {told[STROKE]:.3f} m"])


def as_dict(advice: Recommendation) -> dict[str, Any]:
    """All of it as JSON values, SI."""
    return {
        "runs": list(advice.twin.runs),
        "campaign": display_path(advice.base),
        "sea": advice.campaign.file.sea.description(),
        "station": advice.asked.station,
        "best": _tried(advice.best),
        "optima": [
            {"station": o.station, "law": o.law, "at_limit": o.at_limit, **_tried(o.best, told)}
            for o, told in zip(advice.optima, advice.optima_intervals, strict=True)
        ],
        "rows": [
            {"why": row.why, **_tried(row.tried, told)}
            for row, told in zip(advice.rows, advice.intervals, strict=True)
        ],
        "measured": [
            {"row": c.place, **c.gains._asdict(), "measured": c.measured, "predicted": c.predicted}
            for c in advice.measured
        ],
        "notes": list(advice.twin.notes),
    }


def _tried(one: Tried, told: dict[str, float] | None = None) -> dict[str, Any]:
    found: dict[str, Any] = one.gains._asdict()
    found |= {f"power_{station}_w": one.power(station) for station in STATIONS}
    found |= {"stroke_m": one.foreseen.stroke, "current_rms_a": one.foreseen.current_rms}
    if told is not None:
        found["half_width_95"] = dict(told)
    return found


def as_text(advice: Recommendation) -> str:
    """For people: the best of each law, the rows, how measured rows were met."""
    lines = [*_head(advice)[:2], "", "Best by station and law", *_optima(advice)]
    rows = [
        ("spring", "Kp", "Ki", *SHORT.values(), "±", "stroke m", "why"),
        *(
            (*_gains(row.tried), *_watts(row.tried), f"{told[advice.asked.station]:.1f}",
             f"{row.tried.foreseen.stroke:.3f}", row.why)
            for row, told in zip(advice.rows, advice.intervals, strict=True)
        ),
    ]  # fmt: skip
    name = SHORT[advice.asked.station]
    lines += ["", f"Rows of the next campaign (± of {name}, 95 %)", *_aligned(rows)]
    if advice.measured:
        lines += ["", "Measured rows of this sea less their prediction, W", *_met(advice)]
    lines += ["", *(f"!! {note}" for note in advice.twin.notes)]
    return "\n".join(lines)


def _optima(advice: Recommendation) -> list[str]:
    head = ("for", "law", "spring N/m", "Kp N·s/m", "Ki N/m", *(f"{s} W" for s in SHORT.values()),
            "±", "x stroke m", "")  # fmt: skip
    body = [
        (words(o.station), o.law, *_gains(o.best), *_watts(o.best), f"{told[o.station]:.1f}",
         f"{o.best.foreseen.stroke:.3f}", "at a limit" if o.at_limit else "")
        for o, told in zip(advice.optima, advice.optima_intervals, strict=True)
    ]  # fmt: skip
    return _aligned([head, *body])


def _met(advice: Recommendation) -> list[str]:
    found: list[tuple[str, ...]] = []
    for station in STATIONS:
        off = [c.measured[station] - c.predicted[station] for c in advice.measured]
        mean = sum(off) / len(off)
        worst = max(off, key=abs)
        found.append((SHORT[station], f"mean {mean:+.2f}", f"worst {worst:+.2f}"))
    return _aligned(found)


def _gains(one: Tried) -> tuple[str, str, str]:
    return (f"{one.gains.spring_rate:.0f}", f"{one.gains.kp:.0f}", f"{one.gains.ki:.0f}")


def _watts(one: Tried) -> tuple[str, ...]:
    return tuple(f"{one.power(station):.1f}" for station in STATIONS)


def _aligned(rows: list[tuple[str, ...]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    out = []
    for row in rows:
        cells = [
            cell.rjust(w) if _number(cell) else cell.ljust(w)
            for cell, w in zip(row, widths, strict=True)
        ]
        out.append("  " + "  ".join(cells).rstrip())
    return out


def _number(cell: str) -> bool:
    return cell.replace("-", "").replace("+", "").replace(".", "").isdigit()
