"""The open-loop reference of a campaign: a force that repeats, beside the feedback of the laws.

It pushes one axis. Amplitudes are the greatest magnitude of the whole signal, as drive current as
the MASK4 test gave them (10 A is 770 N on the body) or as force.
"""

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from rig.config.matrix import expanded
from rig.config.model import Broken, FileModel, Several, Whole
from rig.config.problems import number_text

LONGEST_S = 3600
"""Longest time after which a reference repeats, s."""

Amplitude = Annotated[float, Field(gt=0, le=40)]
Frequency = Annotated[float, Field(ge=0.02, le=5)]
Band = Annotated[float, Field(ge=0.01, le=5)]
RepeatPeriod = Annotated[float, Field(ge=1, le=LONGEST_S)]

_NEARLY = 1e-9  # of a period: rounding


class _Stimulus(FileModel):
    """What all references have: the axis they push and how hard."""

    axis: Literal["heave", "surge"] = "heave"
    amplitude_a: Amplitude | None = None
    amplitude_n: float | None = Field(default=None, gt=0, le=4000)

    def broken_rules(self) -> Iterator[Broken]:
        """One amplitude."""
        if self.amplitude_a is None and self.amplitude_n is None:
            yield Broken(
                (), "amplitude missing; allowed amplitude_a 0 .. 40 A or amplitude_n 0 .. 4000 N"
            )
        if self.amplitude_a is not None and self.amplitude_n is not None:
            message = "amplitude_a is given already; allowed one of the two"
            yield Broken(("amplitude_n",), message, self.amplitude_n)

    def newtons(self, newtons_per_ampere: float) -> float:
        """The amplitude as force on the body, N; the factor is the axis's Kt N."""
        if self.amplitude_n is not None:
            return self.amplitude_n
        assert self.amplitude_a is not None
        return self.amplitude_a * newtons_per_ampere

    def size_description(self) -> str:
        """Axis and amplitude."""
        size = (
            f"{number_text(self.amplitude_n)} N"
            if self.amplitude_n is not None
            else f"{number_text(self.amplitude_a or 0.0)} A"
        )
        return f"{self.axis}, {size} at most"


class SineReference(_Stimulus):
    """One sine, zero at zero of the wave clock."""

    kind: Literal["sine"]
    frequency_hz: Frequency

    @property
    def period(self) -> float:
        """Seconds after which the force is the same again."""
        return 1.0 / self.frequency_hz

    def description(self) -> str:
        """The reference in a line."""
        return f"sine, {self.size_description()}, {number_text(self.frequency_hz)} Hz"


class SteppedSineReference(_Stimulus):
    """Sines one after another, each held for the same time, without a jump between them."""

    kind: Literal["stepped sine"]
    frequencies_hz: Annotated[Several[Frequency], BeforeValidator(expanded)]
    hold_s: float = Field(ge=1, le=600)

    def broken_rules(self) -> Iterator[Broken]:
        """Each sine ends its hold as it began it, and all of them end in time."""
        yield from super().broken_rules()
        for i, frequency in enumerate(self.frequencies_hz):
            cycles = frequency * self.hold_s
            whole = max(1, round(cycles))
            if abs(cycles - whole) > _NEARLY * cycles:
                yield Broken(
                    ("frequencies_hz", i),
                    f"{number_text(frequency)} does not fit whole periods into hold_s = "
                    f"{number_text(self.hold_s)} s; the nearest that does is "
                    f"{number_text(whole / self.hold_s)} Hz",
                    frequency,
                )
        if self.period > LONGEST_S:
            message = f"{number_text(self.period)} s in all; allowed up to {LONGEST_S} s"
            yield Broken(("hold_s",), message, self.hold_s)

    @property
    def period(self) -> float:
        """Seconds after which the force is the same again."""
        return self.hold_s * len(self.frequencies_hz)

    def description(self) -> str:
        """The reference in a line."""
        low, high = min(self.frequencies_hz), max(self.frequencies_hz)
        return (
            f"stepped sine, {self.size_description()}, {len(self.frequencies_hz)} frequencies "
            f"{number_text(low)} .. {number_text(high)} Hz, {number_text(self.hold_s)} s each"
        )


class _OfABand(_Stimulus):
    """What references of a frequency band have."""

    low_hz: Band = 0.2
    high_hz: Band = 1.0
    repeat_s: RepeatPeriod = 300.0

    def broken_rules(self) -> Iterator[Broken]:
        """The band has an upper end above its lower one, and a multiple of 1/repeat in it."""
        yield from super().broken_rules()
        if self.high_hz <= self.low_hz:
            yield Broken(
                ("high_hz",),
                f"{number_text(self.high_hz)} is not above low_hz = {number_text(self.low_hz)} Hz",
                self.high_hz,
            )
        elif math.floor(self.high_hz * self.repeat_s + 1e-6) < self.low_hz * self.repeat_s - 1e-6:
            message = (
                f"no multiple of 1/{number_text(self.repeat_s)} Hz lies between "
                f"{number_text(self.low_hz)} and {number_text(self.high_hz)} Hz"
            )
            yield Broken(("repeat_s",), message, self.repeat_s)

    @property
    def period(self) -> float:
        """Seconds after which the force is the same again."""
        return self.repeat_s

    def band_description(self) -> str:
        """Band and repeat period."""
        return (
            f"{number_text(self.low_hz)} .. {number_text(self.high_hz)} Hz, "
            f"repeats after {number_text(self.repeat_s)} s"
        )


class ChirpReference(_OfABand):
    """A sine that sweeps the band once a repeat period, from its lower end to its upper one.

    The sweep is moved by less than half a line 1/repeat so that it ends where it began.
    """

    kind: Literal["chirp"]
    sweep: Literal["linear", "logarithmic"] = "linear"

    def description(self) -> str:
        """The reference in a line."""
        return f"chirp, {self.sweep}, {self.size_description()}, {self.band_description()}"


class MultisineReference(_OfABand):
    """Lines k/repeat of a band with random phases, the best of many draws.

    ``lines``: all of them, odd k only, or odd k of which one in four is left out at random. What
    the device answers on a line that was left out is its nonlinearity.
    """

    kind: Literal["multisine"]
    colour: Literal["flat", "pink"] = "flat"
    lines: Literal["all", "odd", "random odd"] = "all"
    draws: Whole = Field(default=100, ge=1, le=1000)
    seed: Whole | None = Field(default=None, ge=0, le=4_294_967_295)  # the campaign's if missing
    realisation: Whole = Field(default=1, ge=1, le=100)  # where the matrix has no such column

    def description(self) -> str:
        """The reference in a line."""
        which = "" if self.lines == "all" else f", {self.lines} lines"
        return (
            f"multisine, {self.colour}{which}, {self.size_description()}, {self.band_description()}, "
            f"realisation {self.realisation}"
        )


class RecordedReference(FileModel):
    """A force from a CSV file, played from ``start_s`` to ``end_s`` and over again.

    Between samples it is a straight line; the matrix's column reference_scale makes it larger.
    """

    kind: Literal["recorded"]
    axis: Literal["heave", "surge"] = "heave"
    file: str = Field(min_length=1)  # .csv, relative to this one
    channel: str = Field(min_length=1)
    start_s: float = Field(default=0.0, ge=0, le=1e6)
    end_s: float = Field(gt=0, le=1e6)
    unit: Literal["A", "N"]  # of the channel
    rate_hz: float | None = Field(default=None, ge=1, le=10_000)  # checked against the time column

    def broken_rules(self) -> Iterator[Broken]:
        """A window of a file we can read, not too long."""
        if not self.file.lower().endswith(".csv"):
            yield Broken(("file",), f"{self.file!r} is not read; allowed *.csv", self.file)
        if not 1.0 <= self.period <= LONGEST_S:
            yield Broken(
                ("end_s",),
                f"{number_text(self.period)} s to play; allowed 1 .. {LONGEST_S} s "
                f"from start_s = {number_text(self.start_s)} s",
                self.end_s,
            )

    @property
    def period(self) -> float:
        """Seconds after which the force is the same again."""
        return self.end_s - self.start_s

    def description(self) -> str:
        """The reference in a line."""
        return (
            f"recorded, {self.axis}, {self.channel} of {self.file}, "
            f"{number_text(self.start_s)} .. {number_text(self.end_s)} s"
        )


def whole_seconds(frequency: float) -> Fraction | None:
    """The frequency (Hz) as a fraction of whole seconds up to an hour; None if it is none."""
    found = Fraction(frequency).limit_denominator(LONGEST_S)
    return found if abs(float(found) - frequency) <= 1e-12 else None


AnyStimulus = (
    SineReference | SteppedSineReference | ChirpReference | MultisineReference | RecordedReference
)
AnyReference = AnyStimulus | None
Reference = Annotated[AnyStimulus, Field(discriminator="kind")]
