"""The open-loop reference as the loop takes it: repeat periods of force, one value a tick."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.config.problems import Problem
from rig.config.reference import (
    LONGEST_S,
    AnyReference,
    AnyStimulus,
    ChirpReference,
    MultisineReference,
    RecordedReference,
    SineReference,
    SteppedSineReference,
    whole_seconds,
)
from rig.planning.campaign.elevation import read_window
from rig.planning.campaign.multisine import (
    Floats,
    design,
    odd_lines,
    scaled_to_peak,
    series,
    some_odd_lines,
)
from rig.planning.campaign.point import Point

MOST_ENTRIES = 8_000_000
"""Longest table: all realisations of a campaign together."""


class Record(NamedTuple):
    """The samples of a recorded reference."""

    rate_hz: float
    value: Floats  # in the unit of the file


def read_record(path: Path, reference: RecordedReference) -> Record:
    """The window of a recorded reference; raises `ConfigError` naming file and line."""
    window = (reference.start_s, reference.end_s)
    return Record(*read_window(path, reference.channel, window, reference.rate_hz))


def table(
    reference: AnyReference,
    newtons_per_ampere: float,
    rate_hz: int,
    seed: int,
    realisations: Iterable[int] = (1,),
    record: Record | None = None,
) -> tuple[float, ...]:
    """Force on the body (N) over one repeat period of each realisation; empty without a reference.

    ``seed`` is for a multisine that has none of its own, ``record`` for a recorded one; only a
    multisine has more realisations than one. Raises ValueError where the signal does not repeat
    after a whole number of ticks, or the table would be too long.
    """
    if reference is None:
        return ()
    several = list(realisations) if isinstance(reference, MultisineReference) else [1]
    ticks = ticks_of(reference, rate_hz)
    if ticks * len(several) > MOST_ENTRIES:
        raise ValueError(
            f"{len(several)} realisations of {ticks} ticks; allowed {MOST_ENTRIES} in all"
        )
    if isinstance(reference, RecordedReference):
        if record is None:
            raise ValueError("its record was not read")
        scale = newtons_per_ampere if reference.unit == "A" else 1.0
        return tuple((scale * _resampled(record, ticks, rate_hz)).tolist())
    scale = reference.newtons(newtons_per_ampere)
    periods = [_period(reference, scale, ticks, seed, one) for one in several]
    return tuple(np.concatenate(periods).tolist())


def unplayable(
    reference: AnyReference, points: tuple[Point, ...], rate_hz: int
) -> Iterator[Problem]:
    """A problem for the first point whose realisation the reference cannot play."""
    asked = {p.given["realisation"]: p for p in points if "realisation" in p.given}
    several = isinstance(reference, MultisineReference)
    for number, point in asked.items():
        if not several and number != 1.0:
            message = "only a multisine reference has realisations; allowed 1"
            yield point.at["realisation"].problem(number, message)
            return
    if several and reference is not None:
        entries = reference.period * rate_hz * max(1, len(asked))
        if asked and entries > MOST_ENTRIES:
            most = int(MOST_ENTRIES // (reference.period * rate_hz))
            last = asked[max(asked)]
            message = f"{len(asked)} realisations of this length; allowed {most} in a campaign"
            yield last.at["realisation"].problem(max(asked), message)


def ticks_of(reference: AnyStimulus, rate_hz: int) -> int:
    """Ticks after which the force repeats; ValueError where it is no whole number of them."""
    if isinstance(reference, SineReference):
        whole = whole_seconds(reference.frequency_hz)
        if whole is None:
            near = reference.frequency_hz
            raise ValueError(f"a sine of {near!r} Hz repeats on no whole second up to {LONGEST_S}")
        return whole.denominator * rate_hz
    ticks = reference.period * rate_hz
    if abs(ticks - round(ticks)) > 1e-6:
        raise ValueError(f"repeats after {reference.period!r} s, no whole number of ticks")
    return round(ticks)


def _period(
    reference: SineReference | SteppedSineReference | ChirpReference | MultisineReference,
    scale: float,
    ticks: int,
    seed: int,
    realisation: int,
) -> Floats:
    """One repeat period, N."""
    time = np.arange(ticks) / ticks  # of the period
    if isinstance(reference, SineReference):
        whole = whole_seconds(reference.frequency_hz)
        assert whole is not None
        return np.asarray(scale * np.sin(2.0 * np.pi * whole.numerator * time))
    if isinstance(reference, SteppedSineReference):
        count = len(reference.frequencies_hz)
        held = time * count
        which = np.minimum(held.astype(np.int64), count - 1)
        cycles = np.round(np.array(reference.frequencies_hz) * reference.hold_s)
        return np.asarray(scale * np.sin(2.0 * np.pi * cycles[which] * (held - which)))
    if isinstance(reference, ChirpReference):
        return np.asarray(scale * np.sin(2.0 * np.pi * _swept(reference, time)))
    own = seed if reference.seed is None else reference.seed
    choose = {"all": None, "odd": odd_lines, "random odd": some_odd_lines(own)}
    signal = design(
        reference.low_hz,
        reference.high_hz,
        reference.repeat_s,
        rms=1.0,
        exponent=-0.5 if reference.colour == "pink" else 0.0,
        seed=own,
        realisation=realisation,
        draws=reference.draws,
        choose=choose[reference.lines],
    )
    return series(scaled_to_peak(signal, scale), ticks)


def _swept(chirp: ChirpReference, time: Floats) -> Floats:
    """Cycles of a chirp since the period began, a whole number of them in all."""
    low, high = chirp.low_hz, chirp.high_hz
    if chirp.sweep == "linear":
        cycles = low * time + 0.5 * (high - low) * time * time
        whole = 0.5 * (low + high)
    else:
        ratio = np.log(high / low)
        cycles = low * np.expm1(ratio * time) / ratio
        whole = (high - low) / ratio
    moved: Floats = cycles * (max(1, round(whole * chirp.repeat_s)) / whole)
    return moved


def _resampled(record: Record, ticks: int, rate_hz: int) -> Floats:
    """The record at the loop's rate; its last sample leads back to its first."""
    count = len(record.value)
    at = np.arange(ticks) * (record.rate_hz / rate_hz)
    played: Floats = np.interp(at, np.arange(count + 1), np.append(record.value, record.value[0]))
    return played
