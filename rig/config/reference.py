"""The open-loop reference of a campaign: a periodic force in addition to the feedback of the laws.

A reference excites one axis. Its amplitude is the greatest magnitude of the whole signal, given as
drive current, as in the MASK4 test (10 A is 770 N on the body), as force, or as the torque about an
axis that rotates.
"""

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from rig.config.matrix import expand_values
from rig.config.model import FileModel, RuleViolation, TupleOf, WholeNumber
from rig.config.problems import format_number

MAX_REPEAT_S = 3600
"""Maximum repeat period of a reference, s."""

Amplitude = Annotated[float, Field(gt=0, le=1000)]
_AMPLITUDE_UNITS = {"amplitude_a": "A", "amplitude_n": "N", "amplitude_n_m": "N*m"}
ForceAmplitude = Annotated[float, Field(gt=0, le=1e6)]
Frequency = Annotated[float, Field(ge=0.02, le=5)]
Band = Annotated[float, Field(ge=0.01, le=5)]
RepeatPeriod = Annotated[float, Field(ge=1, le=MAX_REPEAT_S)]

ProfilePoint = Annotated[
    tuple[Annotated[float, Field(ge=0, le=MAX_REPEAT_S)], Annotated[float, Field(ge=-1, le=1)]],
    Field(strict=False),
]
"""Time of a profile's point, s, and its share of the amplitude."""

_ROUNDING = 1e-9  # relative tolerance for a whole number of periods


class _Stimulus(FileModel):
    """Axis and amplitude of a generated reference."""

    axis: str = ""  # a campaign file fills in the first axis of its rig
    amplitude_a: Amplitude | None = None
    """Greatest magnitude of the whole signal, as motor current."""
    amplitude_n: ForceAmplitude | None = None
    """The same as force on the body, in place of amplitude_a."""
    amplitude_n_m: ForceAmplitude | None = None
    """The same as torque about an axis that rotates."""

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that exactly one amplitude is given."""
        missing = (
            "amplitude missing; allowed amplitude_a 0 .. 1000 A, or amplitude_n 0 .. 1e+06 N, of a "
            "rotating axis amplitude_n_m 0 .. 1e+06 N*m"
        )
        yield from self.check_one_of(*_AMPLITUDE_UNITS, missing=missing)

    def force_amplitude(self, newtons_per_ampere: float) -> float:
        """Return the amplitude as force on the body, N, or torque, N*m; the factor is Kt N."""
        key, unit = self.quantity
        amplitude: float = getattr(self, key)
        return amplitude * newtons_per_ampere if unit == "A" else amplitude

    @property
    def quantity(self) -> tuple[str, str]:
        """Key and unit of the amplitude."""
        given = (each for each in _AMPLITUDE_UNITS.items() if getattr(self, each[0]) is not None)
        return next(given)

    def amplitude_description(self) -> str:
        """Return axis and amplitude as text."""
        key, unit = self.quantity
        return f"{self.axis}, {format_number(getattr(self, key))} {unit} at most"


class SineReference(_Stimulus):
    """One sine, which is zero at 0 s of the wave clock."""

    kind: Literal["sine"]
    frequency_hz: Frequency  # of the sine

    @property
    def period(self) -> float:
        """Repeat period of the force, s."""
        return 1.0 / self.frequency_hz

    def description(self) -> str:
        """Return one line of text."""
        return f"sine, {self.amplitude_description()}, {format_number(self.frequency_hz)} Hz"


class SteppedSineReference(_Stimulus):
    """A sequence of sines of equal duration, without a step between them."""

    kind: Literal["stepped sine"]
    frequencies_hz: Annotated[TupleOf[Frequency], BeforeValidator(expand_values)]
    """Of the steps, one after the other."""
    hold_s: float = Field(ge=1, le=600)  # time at each frequency

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check whole periods of each sine within its hold, and the total duration."""
        yield from super().check_rules()
        for i, frequency in enumerate(self.frequencies_hz):
            cycles = frequency * self.hold_s
            whole = max(1, round(cycles))
            if abs(cycles - whole) > _ROUNDING * cycles:
                yield RuleViolation(
                    ("frequencies_hz", i),
                    f"{format_number(frequency)} does not fit whole periods into hold_s = "
                    f"{format_number(self.hold_s)} s; the nearest that does is "
                    f"{format_number(whole / self.hold_s)} Hz",
                    frequency,
                )
        if self.period > MAX_REPEAT_S:
            message = f"{format_number(self.period)} s in all; allowed up to {MAX_REPEAT_S} s"
            yield self.violation("hold_s", message)

    @property
    def period(self) -> float:
        """Repeat period of the force, s."""
        return self.hold_s * len(self.frequencies_hz)

    def description(self) -> str:
        """Return one line of text."""
        low, high = min(self.frequencies_hz), max(self.frequencies_hz)
        return (
            f"stepped sine, {self.amplitude_description()}, {len(self.frequencies_hz)} frequencies "
            f"{format_number(low)} .. {format_number(high)} Hz, {format_number(self.hold_s)} s each"
        )


class _BandStimulus(_Stimulus):
    """Band and repeat period of a reference on a frequency band."""

    low_hz: Band = 0.2  # lower end of the band
    high_hz: Band = 1.0  # upper end of the band
    repeat_s: RepeatPeriod = 300.0  # period after which the signal repeats

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the band is not empty and contains a multiple of 1/repeat."""
        yield from super().check_rules()
        if self.high_hz <= self.low_hz:
            low = format_number(self.low_hz)
            message = f"{format_number(self.high_hz)} is not above low_hz = {low} Hz"
            yield self.violation("high_hz", message)
        elif math.floor(self.high_hz * self.repeat_s + 1e-6) < self.low_hz * self.repeat_s - 1e-6:
            message = (
                f"no multiple of 1/{format_number(self.repeat_s)} Hz lies between "
                f"{format_number(self.low_hz)} and {format_number(self.high_hz)} Hz"
            )
            yield self.violation("repeat_s", message)

    @property
    def period(self) -> float:
        """Repeat period of the force, s."""
        return self.repeat_s

    def band_description(self) -> str:
        """Return band and repeat period as text."""
        return (
            f"{format_number(self.low_hz)} .. {format_number(self.high_hz)} Hz, "
            f"repeats after {format_number(self.repeat_s)} s"
        )


class ChirpReference(_BandStimulus):
    """A sine that sweeps the band once per repeat period, from the lower end to the upper end.

    The frequencies are shifted by less than half of 1/repeat, so that the signal is periodic.
    """

    kind: Literal["chirp"]
    sweep: Literal["linear", "logarithmic"] = "linear"  # frequency over time

    def description(self) -> str:
        """Return one line of text."""
        return f"chirp, {self.sweep}, {self.amplitude_description()}, {self.band_description()}"


class MultisineReference(_BandStimulus):
    """Lines k/repeat of a band with random phases, from the best of many draws.

    ``lines`` selects all k, odd k, or odd k of which a random one in four is omitted. The response
    on an omitted line shows the nonlinearity of the device.
    """

    kind: Literal["multisine"]
    colour: Literal["flat", "pink"] = "flat"  # of the amplitudes over frequency
    lines: Literal["all", "odd", "random odd"] = "all"  # multiples of 1/repeat_s
    draws: WholeNumber = Field(default=100, ge=1, le=1000)
    """Number of draws of the phases, of which the best is kept."""
    # None: the campaign's seed
    seed: WholeNumber | None = Field(default=None, ge=0, le=4_294_967_295)  # of the random phases
    realisation: WholeNumber = Field(default=1, ge=1, le=100)  # without such a matrix column

    def description(self) -> str:
        """Return one line of text."""
        lines = "" if self.lines == "all" else f", {self.lines} lines"
        return (
            f"multisine, {self.colour}{lines}, {self.amplitude_description()}, "
            f"{self.band_description()}, realisation {self.realisation}"
        )


class NoiseReference(_BandStimulus):
    """Gaussian noise of a band: lines k/repeat with random amplitudes and phases."""

    kind: Literal["noise"]
    # None: the campaign's seed
    seed: WholeNumber | None = Field(default=None, ge=0, le=4_294_967_295)  # of the noise

    def description(self) -> str:
        """Return one line of text."""
        return f"noise, {self.amplitude_description()}, {self.band_description()}"


class ProfileReference(_Stimulus):
    """Straight lines between points (s, share of the amplitude); two points at one time: a step.

    Ramps, steps, trapezoids. The first share holds from 0 s on, the last one to the end.
    """

    kind: Literal["profile"]
    points: TupleOf[ProfilePoint] = Field(min_length=1, max_length=1000)
    repeat_s: RepeatPeriod  # period after which the signal repeats

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that times ascend within the repeat period and that some share is 1 or -1."""
        yield from super().check_rules()
        before, repeat = 0.0, format_number(self.repeat_s)
        for i, (time, _) in enumerate(self.points):
            if not before <= time <= self.repeat_s:
                message = f"{format_number(time)} s: times ascend from 0 to repeat_s = {repeat} s"
                yield RuleViolation(("points", i), message, time)
                return
            before = time
        largest = max(abs(share) for _, share in self.points)
        if largest != 1.0:
            yield self.violation(
                "points",
                f"the largest share is {format_number(largest)}; it must be 1 or -1, at which the "
                "force has its amplitude",
            )

    @property
    def period(self) -> float:
        """Repeat period of the force, s."""
        return self.repeat_s

    def description(self) -> str:
        """Return one line of text."""
        return (
            f"profile of {len(self.points)} points, {self.amplitude_description()}, repeats after "
            f"{format_number(self.repeat_s)} s"
        )


class RecordedReference(FileModel):
    """A force from a CSV file, played from ``start_s`` to ``end_s`` repeatedly.

    The force is interpolated linearly; the matrix column reference_scale multiplies it.
    """

    kind: Literal["recorded"]
    axis: str = ""  # a campaign file fills in the first axis of its rig
    file: str = Field(min_length=1)  # .csv, relative to this one
    channel: str = Field(min_length=1)  # column of the file
    start_s: float = Field(default=0.0, ge=0, le=1e6)  # beginning of the part of the record
    end_s: float = Field(gt=0, le=1e6)  # end of the part of the record
    unit: Literal["A", "N", "N*m"]  # of the channel; N*m of an axis that rotates
    rate_hz: float | None = Field(default=None, ge=1, le=10_000)  # checked against the time column

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the file's suffix and the duration of the window."""
        if not self.file.lower().endswith(".csv"):
            yield self.violation("file", f"{self.file!r} cannot be read; allowed *.csv")
        if not 1.0 <= self.period <= MAX_REPEAT_S:
            yield self.violation(
                "end_s",
                f"{format_number(self.period)} s to play; allowed 1 .. {MAX_REPEAT_S} s "
                f"from start_s = {format_number(self.start_s)} s",
            )

    @property
    def period(self) -> float:
        """Repeat period of the force, s."""
        return self.end_s - self.start_s

    @property
    def quantity(self) -> tuple[str, str]:
        """Key and value of the unit."""
        return "unit", self.unit

    def description(self) -> str:
        """Return one line of text."""
        return (
            f"recorded, {self.axis}, {self.channel} of {self.file}, "
            f"{format_number(self.start_s)} .. {format_number(self.end_s)} s"
        )


def rational_frequency(frequency: float) -> Fraction | None:
    """Return a frequency (Hz) as a fraction whose denominator is the repeat period, s.

    The denominator is at most `MAX_REPEAT_S`; None if no such fraction equals the frequency.
    """
    fraction = Fraction(frequency).limit_denominator(MAX_REPEAT_S)
    return fraction if abs(float(fraction) - frequency) <= 1e-12 else None


GeneratedReference = (
    SineReference
    | SteppedSineReference
    | ChirpReference
    | MultisineReference
    | NoiseReference
    | ProfileReference
)
AnyStimulus = GeneratedReference | RecordedReference
AnyReference = AnyStimulus | None
Reference = Annotated[AnyStimulus, Field(discriminator="kind")]
