"""The next gain matrix: which rows tell most, and the campaign file that runs them.

First the best setting for the station asked for, then points around it on each axis, as far away
as costs about what the prediction is unsure by (so the rows see the valley's sides, and come closer
as rows are measured); then what other stations and laws would choose; then corners, while rows are
left.
"""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.config.yaml_source import load_mapping
from rig.design.recommend.search import Optimum, Room, Station
from rig.design.recommend.trial import Bench, Gains, Tried
from rig.planning.campaign.stability import largest_ki

LEAST_RISE = 0.5  # W, by which points around are worse than their middle
MOST_RISE = 4.0  # W
LEAST_APART = (20.0, 20.0, 20.0)  # N s/m, N/m, N/m: nearer settings are one row
_REACH = (0.5, 4000.0, 4000.0)  # log Kp, N/m, N/m: farthest that a point around may lie
_FINEST = 10.0  # N s/m, N/m: gains are written in steps of this
FORMS = ("grid", "csv", "list")


class Wanted(NamedTuple):
    """What rows are wanted."""

    room: Room
    station: Station
    most: int


class Row(NamedTuple):
    """A row of the recommended matrix and why it is there."""

    tried: Tried
    why: str


def rows(
    bench: Bench, quick: Bench, found: Sequence[Optimum], asked: Wanted, unsure: float
) -> list[Row]:
    """The rows, the best first; ``unsure`` (W) is the half width at the best."""
    room, station, most = asked
    best = next(o for o in found if o.station == station and o.law == "PI and spring").best
    rise = min(max(unsure, LEAST_RISE), MOST_RISE)
    wanted: dict[Gains, str] = {}
    for gains, why in _wanted(quick, room, found, best, station, rise):
        written = _written(gains, room)
        if not any(_same(written, other) for other in wanted):
            wanted[written] = why
    told = zip(bench.tried(list(wanted)), wanted.values(), strict=True)
    return [Row(one, why) for one, why in told if one.allowed][:most]


def _wanted(
    quick: Bench, room: Room, found: Sequence[Optimum], best: Tried, station: Station, rise: float
) -> Iterator[tuple[Gains, str]]:
    name = words(station)
    yield best.gains, f"best {name}"
    distances = [_distance(quick, room, best.gains, station, axis, rise) for axis in range(3)]
    middle = room.place(best.gains)
    for axis, step in enumerate(distances):
        for sign in (1.0, -1.0):
            place = middle.copy()
            place[axis] += sign * step
            yield room.gains(place), f"around it: {'more' if sign > 0.0 else 'less'} {_AXES[axis]}"
    for one in found:
        if one.law == "PI and spring" and one.station != station:
            yield one.best.gains, f"best {words(one.station)}"
    for one in found:
        if one.law != "PI and spring" and one.station == station:
            yield one.best.gains, f"best {name} with {one.law} alone"
    for corner in np.stack(np.meshgrid(*[[1.0, -1.0]] * 3, indexing="ij"), -1).reshape(-1, 3):
        yield room.gains(middle + 0.7 * corner * distances), "corner around the best"


_AXES = ("damping", "Ki", "spring rate")


def words(station: str) -> str:
    """A station as people say it."""
    return {"mechanical_1": "mechanical power", "ac": "AC power", "dc": "DC power"}[station]


def _distance(
    quick: Bench, room: Room, best: Gains, station: Station, axis: int, rise: float
) -> float:
    """How far along an axis the power of a station is worse by ``rise`` (W)."""
    middle, step = room.place(best), np.zeros(3)
    step[axis] = 0.5 * _REACH[axis]
    at, *sides = quick.tried([room.gains(middle + sign * step) for sign in (0.0, 1.0, -1.0)])
    worse = float(np.mean([one.power(station) for one in sides])) - at.power(station)
    bend = max(worse, 1e-3) / (0.25 * _REACH[axis] ** 2)
    return min(float(np.sqrt(rise / bend)), _REACH[axis])


def _written(gains: Gains, room: Room) -> Gains:
    """In round numbers, within what the rig's map and stability allow."""
    kp, ki, rate = gains
    low, high = room.spring
    inward = min(max(_FINEST * round(rate / _FINEST), low), high)
    most = largest_ki(room.rig.stability, inward)
    down = _FINEST * float(np.floor(most / _FINEST))
    return Gains(_FINEST * round(kp / _FINEST), min(_FINEST * round(ki / _FINEST), down), inward)


def _same(one: Gains, other: Gains) -> bool:
    apart = zip(one, other, LEAST_APART, strict=True)
    return all(abs(a - b) < least for a, b, least in apart)


def campaign_text(path: Path, base: Path, name: str, lines: Sequence[str], made: Sequence[Row],
                  beside: Sequence[str]) -> str:  # fmt: skip
    """The campaign file: what the base is, with another matrix.

    ``path`` is where it will stand, ``lines`` are told at its head, ``beside`` behind each row.
    """
    mapping, _ = load_mapping(base, inline=("sea",))
    inherited = mapping.get("matrix") or {}
    out = [f"# {line}" for line in lines]
    out += [
        f"extends: {_relative(base, path)}",
        f"name: {name}",
        "repeat: 1",
        "order: fewest spring moves",
        "matrix:",
        *(f"  {form}:" for form in FORMS[:2] if form in inherited),
        "  list:",
    ]
    settings = [_flow(row.tried.gains, inherited, mapping) for row in made]
    widest = max(len(text) for text in settings)
    out += [f"    - {s:<{widest}}  # {b}" for s, b in zip(settings, beside, strict=True)]
    return "\n".join(out) + "\n"


def _flow(gains: Gains, inherited: dict[str, Any], mapping: dict[str, Any]) -> str:
    pairs = {
        "spring_n_per_m": gains.spring_rate, "kp_n_s_per_m": gains.kp, "ki_n_per_m": gains.ki,
        **_others(inherited),
    }  # fmt: skip
    return "{" + ", ".join(f"{key}: {value:.10g}" for key, value in pairs.items()) + "}"


def _others(inherited: dict[str, Any]) -> dict[str, float]:
    """Columns beside gains and spring, as the first row of the base has them."""
    block = inherited.get("list") or inherited.get("grid") or [{}]
    found: dict[str, float] = {}
    for key, value in block[0].items():
        if key in ("spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m"):
            continue
        first = value["from"] if isinstance(value, dict) else value
        found[key] = float(first[0] if isinstance(first, list) else first)
    return found


def _relative(base: Path, path: Path) -> str:
    return os.path.relpath(base.resolve(), path.resolve().parent)
