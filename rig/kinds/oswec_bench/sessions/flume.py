"""Sessions of a flap: the sea of each row, and its requests to flap and flume."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from rig.config.problems import Problem, format_number
from rig.kinds.oswec_bench.config.session_file import IrregularReference, SessionFile
from rig.kinds.oswec_bench.config.session_kinds import SESSION_KINDS
from rig.kinds.oswec_bench.sessions.rows import SessionPoint
from rig.kinds.oswec_bench.tick.signals import NO_FLUME, Flume
from rig.planning.multisine import Multisine, design_multisine, scale_to_peak

_TICK_TOLERANCE = 1e-6  # ticks


class Sea(NamedTuple):
    """A sea as the wave maker receives it: elevation at the flap's position, without the flap."""

    repeat_s: float
    cycles: tuple[int, ...]
    amplitude_m: tuple[float, ...]
    phase_rad: tuple[float, ...]  # at time zero of the wave clock


def irregular_signal(settings: IrregularReference) -> Multisine:
    """Return an irregular signal of unit peak."""
    multisine = design_multisine(
        settings.low_hz,
        settings.high_hz,
        settings.repeat_s,
        rms=1.0,
        seed=settings.seed,
        draws=settings.draws,
    )
    return scale_to_peak(multisine, 1.0)


def row_sea(file: SessionFile, point: SessionPoint) -> Sea:
    """Return the sea of a row: one cosine, or an irregular sea with the given highest elevation."""
    amplitude = point.values["wave_amplitude"]
    if file.irregular is None:
        return Sea(point.values["period"], (1,), (amplitude,), (0.0,))
    repeat, cycles, shares, phases = irregular_signal(file.irregular)
    amplitudes = (amplitude * shares).tolist()
    return Sea(repeat, tuple(cycles.tolist()), tuple(amplitudes), tuple(phases.tolist()))


def session_seas(file: SessionFile, points: tuple[SessionPoint, ...]) -> tuple[Sea, ...]:
    """Return one sea per point of the file; empty if the session makes no waves."""
    if not SESSION_KINDS[file.session].needs_waves:
        return ()
    return tuple(row_sea(file, point) for point in points)


def row_flume(file: SessionFile, point: SessionPoint, index: int) -> Flume:
    """Return the requests of a row to flap and flume; ``index`` is that of its sea."""
    demand = SESSION_KINDS[file.session]
    if not demand.flap_coupling:
        return NO_FLUME
    return Flume(
        index if demand.needs_waves else -1,
        1 if "release" in point.values else 0,
        math.radians(point.values.get("release", 0.0)),
        point.values.get("pto_damping", 0.0),
    )


def check_wave_periods(
    file: SessionFile, points: tuple[SessionPoint, ...], rate_hz: float
) -> Iterator[Problem]:
    """Yield a problem for each wave period that is no whole number of ticks: a table cannot repeat
    it.
    """
    if not SESSION_KINDS[file.session].needs_waves or file.irregular is not None:
        return
    for point in points:
        ticks = point.values["period"] * rate_hz
        if abs(ticks - round(ticks)) > _TICK_TOLERANCE:
            message = f"{format_number(point.values['period'])} s is no whole number of ticks"
            message += f"; allowed multiples of {format_number(1.0 / rate_hz)} s"
            yield point.locations["period"].problem(point.values["period"], message)
