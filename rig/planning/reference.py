"""The open-loop reference as a table for the loop: repeat periods of force, one value per tick."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.config.problems import Problem
from rig.config.reference import (
    MAX_REPEAT_S,
    AnyReference,
    AnyStimulus,
    ChirpReference,
    GeneratedReference,
    MultisineReference,
    NoiseReference,
    ProfileReference,
    RecordedReference,
    SineReference,
    SteppedSineReference,
    rational_frequency,
)
from rig.planning.elevation import read_channel_window
from rig.planning.multisine import (
    Floats,
    design_multisine,
    draw_noise,
    odd_lines,
    one_period,
    random_odd_lines,
    scale_to_peak,
)
from rig.planning.point import Point

MAX_TABLE_ENTRIES = 8_000_000
"""Maximum length of a table with all realisations of a campaign."""


class ReferenceRecord(NamedTuple):
    """The samples of a recorded reference."""

    rate_hz: float
    values: Floats  # in the unit of the file


def read_reference_record(path: Path, reference: RecordedReference) -> ReferenceRecord:
    """Return the window of a recorded reference; raises `ConfigError` with file and line."""
    window = (reference.start_s, reference.end_s)
    return ReferenceRecord(*read_channel_window(path, reference.channel, window, reference.rate_hz))


def force_table(
    reference: AnyReference,
    newtons_per_ampere: float,
    rate_hz: int,
    seed: int,
    realisations: Iterable[int] = (1,),
    record: ReferenceRecord | None = None,
) -> tuple[float, ...]:
    """Return the force on the body (N) over one repeat period of each realisation.

    The table is empty without a reference. ``newtons_per_ampere`` is Kt N of the axis. ``seed`` is
    used for a multisine without its own seed, ``record`` for a recorded reference; only a
    multisine has more than one realisation. Raises ValueError if the signal does not repeat after
    a whole number of ticks, or if the table would be too long.
    """
    if reference is None:
        return ()
    numbers = list(realisations) if isinstance(reference, MultisineReference) else [1]
    ticks = repeat_ticks(reference, rate_hz)
    if ticks * len(numbers) > MAX_TABLE_ENTRIES:
        raise ValueError(
            f"{len(numbers)} realisations of {ticks} ticks; "
            f"allowed {MAX_TABLE_ENTRIES} ticks in total"
        )
    if isinstance(reference, RecordedReference):
        if record is None:
            raise ValueError("the record of the recorded reference was not read")
        scale = newtons_per_ampere if reference.unit == "A" else 1.0
        return tuple((scale * _resample(record, ticks, rate_hz)).tolist())
    scale = reference.force_amplitude(newtons_per_ampere)
    periods = [_repeat_period(reference, scale, ticks, seed, number) for number in numbers]
    return tuple(np.concatenate(periods).tolist())


def list_realisations(numbers: Iterable[float]) -> tuple[int, ...]:
    """Return the realisations in a campaign's set points, in the order of the reference table."""
    return tuple(sorted({int(number) for number in numbers if number >= 1.0})) or (1,)


def index_realisations(setpoints: Any, realisations: Sequence[int]) -> Any:
    """Return a loop's set points with each realisation as its index in ``realisations``."""
    index = {number: at for at, number in enumerate(realisations)}
    return setpoints._replace(
        realisation=tuple(index.get(int(number), 0) for number in setpoints.realisation)
    )


def realisation_problems(
    reference: AnyReference, points: tuple[Point, ...], rate_hz: int
) -> Iterator[Problem]:
    """Yield a problem for the first point whose realisation the reference does not have."""
    requested = {p.values["realisation"]: p for p in points if "realisation" in p.values}
    is_multisine = isinstance(reference, MultisineReference)
    for number, point in requested.items():
        if not is_multisine and number != 1.0:
            message = "only a multisine reference has realisations; allowed 1"
            yield point.locations["realisation"].problem(number, message)
            return
    if is_multisine and reference is not None:
        entries = reference.period * rate_hz * max(1, len(requested))
        if requested and entries > MAX_TABLE_ENTRIES:
            limit = int(MAX_TABLE_ENTRIES // (reference.period * rate_hz))
            last = requested[max(requested)]
            message = f"{len(requested)} realisations of this length; allowed {limit} in a campaign"
            yield last.locations["realisation"].problem(max(requested), message)


def repeat_ticks(reference: AnyStimulus, rate_hz: int) -> int:
    """Return the ticks after which the force repeats; raises ValueError unless they are whole."""
    if isinstance(reference, SineReference):
        frequency = rational_frequency(reference.frequency_hz)
        if frequency is None:
            raise ValueError(
                f"a sine of {reference.frequency_hz!r} Hz does not repeat on a whole second up to "
                f"{MAX_REPEAT_S} s"
            )
        return frequency.denominator * rate_hz
    ticks = reference.period * rate_hz
    if abs(ticks - round(ticks)) > 1e-6:
        raise ValueError(f"repeats after {reference.period!r} s, not a whole number of ticks")
    return round(ticks)


def _repeat_period(
    reference: GeneratedReference,
    scale: float,
    ticks: int,
    seed: int,
    realisation: int,
) -> Floats:
    """Return one repeat period, N."""
    time = np.arange(ticks) / ticks  # of the period
    if isinstance(reference, SineReference):
        frequency = rational_frequency(reference.frequency_hz)
        assert frequency is not None
        return np.asarray(scale * np.sin(2.0 * np.pi * frequency.numerator * time))
    if isinstance(reference, SteppedSineReference):
        count = len(reference.frequencies_hz)
        holds = time * count  # time in units of one hold
        index = np.minimum(holds.astype(np.int64), count - 1)
        cycles = np.round(np.array(reference.frequencies_hz) * reference.hold_s)
        return np.asarray(scale * np.sin(2.0 * np.pi * cycles[index] * (holds - index)))
    if isinstance(reference, ChirpReference):
        return np.asarray(scale * np.sin(2.0 * np.pi * _chirp_cycles(reference, time)))
    if isinstance(reference, ProfileReference):
        return np.asarray(scale * _profile(reference, ticks))
    phase_seed = seed if reference.seed is None else reference.seed
    if isinstance(reference, NoiseReference):
        noise = draw_noise(reference.low_hz, reference.high_hz, reference.repeat_s, phase_seed)
        return one_period(scale_to_peak(noise, scale), ticks)
    choose = {"all": None, "odd": odd_lines, "random odd": random_odd_lines(phase_seed)}
    signal = design_multisine(
        reference.low_hz,
        reference.high_hz,
        reference.repeat_s,
        rms=1.0,
        exponent=-0.5 if reference.colour == "pink" else 0.0,
        seed=phase_seed,
        realisation=realisation,
        draws=reference.draws,
        choose=choose[reference.lines],
    )
    return one_period(scale_to_peak(signal, scale), ticks)


def _profile(profile: ProfileReference, ticks: int) -> Floats:
    """Return the shares of the amplitude at the ticks of a period; points fall on ticks."""
    at, shares = np.array(profile.points).T
    at, tick = np.round(at * (ticks / profile.repeat_s)), np.arange(ticks)
    # Of two points at one tick the later one holds from this tick on.
    after = np.searchsorted(at, tick, side="right")
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, len(at) - 1)
    span = at[after] - at[before]
    part = np.divide(tick - at[before], span, out=np.zeros(ticks), where=span > 0.0)
    found: Floats = shares[before] + np.clip(part, 0.0, 1.0) * (shares[after] - shares[before])
    return found


def _chirp_cycles(chirp: ChirpReference, time: Floats) -> Floats:
    """Return the cycles of a chirp since the start of the period; their total is whole."""
    low, high = chirp.low_hz, chirp.high_hz
    if chirp.sweep == "linear":
        cycles = low * time + 0.5 * (high - low) * time * time
        mean_hz = 0.5 * (low + high)
    else:
        ratio = np.log(high / low)
        cycles = low * np.expm1(ratio * time) / ratio
        mean_hz = (high - low) / ratio
    return cycles * (max(1, round(mean_hz * chirp.repeat_s)) / mean_hz)


def _resample(record: ReferenceRecord, ticks: int, rate_hz: int) -> Floats:
    """Return the record at the loop's rate; its first sample follows its last one."""
    count = len(record.values)
    position = np.arange(ticks) * (record.rate_hz / rate_hz)  # in samples of the record
    samples = np.append(record.values, record.values[0])
    resampled: Floats = np.interp(position, np.arange(count + 1), samples)
    return resampled
