"""Of a flap's session: the sea of each row, and what else its rows ask of flap and flume."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from rig.config.problems import Problem, format_number
from rig.config.session_file import IrregularReference, SessionFile
from rig.config.session_kinds import SESSION_KINDS
from rig.kinds.oswec_bench.signals import NO_FLUME, Flume
from rig.planning.campaign.multisine import design_multisine, scale_to_peak
from rig.planning.session.rows import SessionPoint

_WHOLE = 1e-6  # ticks


class Lines(NamedTuple):
    """A periodic signal of unit peak: sum share cos(2 pi cycles t / repeat + phase)."""

    repeat: float  # s
    cycles: tuple[int, ...]
    share: tuple[float, ...]
    phase: tuple[float, ...]  # rad


class Sea(NamedTuple):
    """A sea as the wave maker is told: elevation where the flap stands, without the flap."""

    repeat_s: float
    cycles: tuple[int, ...]
    amplitude_m: tuple[float, ...]
    phase_rad: tuple[float, ...]  # at zero of the wave clock


def irregular_lines(told: IrregularReference) -> Lines:
    """The lines of an irregular signal."""
    signal = design_multisine(
        told.low_hz, told.high_hz, told.repeat_s, rms=1.0, seed=told.seed, draws=told.draws
    )
    signal = scale_to_peak(signal, 1.0)
    return Lines(
        told.repeat_s,
        tuple(int(k) for k in signal.cycles),
        tuple(float(a) for a in signal.amplitude),
        tuple(float(phase) for phase in signal.phase),
    )


def sea(file: SessionFile, point: SessionPoint) -> Sea:
    """The sea of a row: one cosine, or an irregular one whose greatest elevation is given."""
    amplitude = point.given["wave_amplitude"]
    if file.irregular is None:
        return Sea(point.given["period"], (1,), (amplitude,), (0.0,))
    lines = irregular_lines(file.irregular)
    sizes = tuple(amplitude * share for share in lines.share)
    return Sea(lines.repeat, lines.cycles, sizes, lines.phase)


def seas(file: SessionFile, points: tuple[SessionPoint, ...]) -> tuple[Sea, ...]:
    """One a point of the file; none where a session makes no waves."""
    if not SESSION_KINDS[file.session].needs_waves:
        return ()
    return tuple(sea(file, point) for point in points)


def flume(file: SessionFile, point: SessionPoint, index: int) -> Flume:
    """What a row asks of flap and flume; ``index`` is that of its sea."""
    told = SESSION_KINDS[file.session]
    if not told.flap_coupling:
        return NO_FLUME
    return Flume(
        index if told.needs_waves else -1,
        1 if "release" in point.given else 0,
        math.radians(point.given.get("release", 0.0)),
        point.given.get("pto_damping", 0.0),
    )


def repeats_in_ticks(
    file: SessionFile, points: tuple[SessionPoint, ...], rate_hz: float
) -> Iterator[Problem]:
    """Waves whose period is no whole number of ticks: a table cannot repeat them."""
    if not SESSION_KINDS[file.session].needs_waves or file.irregular is not None:
        return
    for point in points:
        ticks = point.given["period"] * rate_hz
        if abs(ticks - round(ticks)) > _WHOLE:
            message = f"{format_number(point.given['period'])} s is no whole number of ticks"
            message += f"; allowed multiples of {format_number(1.0 / rate_hz)} s"
            yield point.at["period"].problem(point.given["period"], message)


def as_mapping(of: Sea) -> dict[str, Any]:
    """A sea as plan and devices hold it."""
    return of._asdict()
