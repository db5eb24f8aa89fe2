"""The sea states of campaigns: calm, regular, JONSWAP, pink, multisine or recorded."""

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag

from rig.config.model import FileModel, RuleViolation, TupleOf, WholeNumber, rule_error
from rig.config.problems import format_number

MIN_AMPLITUDE_M, MAX_AMPLITUDE_M = 0.001, 0.5  # of a regular sea
_NOT_HS = "a regular sea is given by its amplitude (amplitude_m), an irregular one by hs_m"
_NOT_TP = "a regular sea has frequency_hz or period_s; tp_s belongs to an irregular one"
_NOT_AMPLITUDE = "an irregular sea is given by hs_m, a regular one by its amplitude"
_NOT_FREQUENCY = "an irregular sea has tp_s; frequency_hz and period_s belong to a regular one"
_NOT_HS_OF_LINES = "the height of a pink or multisine sea is hm0_m or rms_m"
_SEVERAL_SEEDS = "several seeds are a key of the campaign, beside `sea`: seed: [1, 2, 3]"
_NOT_OF_A_BAND = "the band of a pink or multisine sea is low_hz and high_hz"

Height = Annotated[float, Field(ge=0.001, le=1)]
"""Significant wave height, m."""

Repeat = Annotated[float, Field(ge=10, le=3600)]
"""Repeat period of an irregular sea, s."""

Seed = Annotated[WholeNumber, Field(ge=0, le=4_294_967_295)]
"""Seed of random phases."""


def _one_seed(value: Any) -> Any:
    if isinstance(value, list | tuple):
        raise rule_error(_SEVERAL_SEEDS)
    return value


SeedOfSea = Annotated[Seed, BeforeValidator(_one_seed)]
"""Seed of random phases in the sea itself."""

Seeds = Annotated[
    Annotated[Seed, Tag("one")]
    | Annotated[TupleOf[Seed], Field(min_length=2, max_length=100), Tag("several")],
    Discriminator(lambda value: "several" if isinstance(value, list | tuple) else "one"),
]
"""A seed, or a list of them."""


class CalmSea(FileModel):
    """No waves."""

    kind: Literal["calm"]

    def description(self) -> str:
        """Return one line of text."""
        return "calm"


class RegularSea(FileModel):
    """One sine, given by its amplitude (not its height) and either its period or frequency."""

    kind: Literal["regular"]
    amplitude_m: float = Field(ge=MIN_AMPLITUDE_M, le=MAX_AMPLITUDE_M)  # half the wave height
    frequency_hz: float | None = Field(default=None, ge=0.05, le=2)
    """Of the wave; or give the period."""
    period_s: float | None = Field(default=None, ge=0.5, le=20)
    """Of the wave; or give the frequency."""

    foreign_keys: ClassVar[dict[str, str]] = {"hs_m": _NOT_HS, "height_m": _NOT_HS, "tp_s": _NOT_TP}

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that exactly one of frequency and period is given."""
        missing = "frequency missing; allowed frequency_hz 0.05 .. 2 Hz or period_s 0.5 .. 20 s"
        yield from self.check_one_of("frequency_hz", "period_s", missing=missing)

    @property
    def frequency(self) -> float:
        """Wave frequency, Hz."""
        return self.frequency_hz if self.frequency_hz is not None else 1.0 / self.period

    @property
    def period(self) -> float:
        """Wave period, s."""
        if self.period_s is not None:
            return self.period_s
        assert self.frequency_hz is not None
        return 1.0 / self.frequency_hz

    def description(self) -> str:
        """Return one line of text."""
        return (
            f"regular, amplitude {format_number(self.amplitude_m)} m, "
            f"{self.frequency:.4g} Hz (period {self.period:.4g} s)"
        )


class JonswapSea(FileModel):
    """A periodic irregular sea; its amplitudes are scaled so that Hm0 is exactly ``hs_m``."""

    kind: Literal["jonswap"]
    hs_m: Height
    tp_s: float = Field(ge=0.5, le=20)  # peak period
    gamma: float = Field(default=3.3, ge=1, le=7)  # peak enhancement factor
    repeat_s: Repeat = 300.0
    seed: SeedOfSea | None = None  # the campaign's if missing

    foreign_keys: ClassVar[dict[str, str]] = {
        "seeds": _SEVERAL_SEEDS,
        "amplitude_m": _NOT_AMPLITUDE,
        "frequency_hz": _NOT_FREQUENCY,
        "period_s": _NOT_FREQUENCY,
    }

    @property
    def repeat(self) -> float:
        """Repeat period, s."""
        return self.repeat_s

    def description(self) -> str:
        """Return one line of text."""
        return (
            f"JONSWAP, Hs {format_number(self.hs_m)} m, Tp {format_number(self.tp_s)} s, "
            f"gamma {format_number(self.gamma)}, repeats after {format_number(self.repeat_s)} s"
        )


class BandSea(FileModel):
    """A sea on all multiples of 1/repeat in a band, each with a random phase.

    Seed and realisation number determine the phases. The height is exactly Hm0 = 4 rms.
    """

    hm0_m: Height | None = None
    rms_m: float | None = Field(default=None, ge=0.00025, le=0.25)
    """Root mean square of the elevation; or give hm0_m."""
    low_hz: float = Field(default=0.2, ge=0.05, le=2)  # lower end of the band
    high_hz: float = Field(default=1.0, ge=0.05, le=2)  # upper end of the band
    repeat_s: Repeat = 300.0
    seed: SeedOfSea | None = None  # the campaign's if missing
    realisation: WholeNumber = Field(default=1, ge=1, le=1000)  # number of the draw of phases
    largest_m: float | None = Field(default=None, ge=0.001, le=1)  # maximum elevation, if checked

    foreign_keys: ClassVar[dict[str, str]] = {
        "seeds": _SEVERAL_SEEDS,
        "hs_m": _NOT_HS_OF_LINES,
        "amplitude_m": _NOT_HS_OF_LINES,
        "tp_s": _NOT_OF_A_BAND,
        "frequency_hz": _NOT_OF_A_BAND,
        "period_s": _NOT_OF_A_BAND,
    }

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that one height is given and that the band contains a multiple of 1/repeat."""
        missing = "height missing; allowed hm0_m 0.001 .. 1 m or rms_m 0.00025 .. 0.25 m"
        yield from self.check_one_of("hm0_m", "rms_m", missing=missing)
        first, last = self.low_hz * self.repeat_s, self.high_hz * self.repeat_s
        if math.floor(last + 1e-6) < math.ceil(first - 1e-6):
            yield self.violation(
                "high_hz",
                f"{format_number(self.high_hz)} leaves no multiple of 1/repeat_s in the band; "
                f"allowed {format_number(math.ceil(first - 1e-6) / self.repeat_s)} .. 2 Hz",
            )

    @property
    def rms(self) -> float:
        """Root mean square of the elevation, m."""
        if self.rms_m is not None:
            return self.rms_m
        assert self.hm0_m is not None
        return self.hm0_m / 4.0

    @property
    def repeat(self) -> float:
        """Repeat period, s."""
        return self.repeat_s

    def band_description(self) -> str:
        """Return height, band and realisation as text."""
        height = (
            f"rms {format_number(self.rms_m)} m"
            if self.rms_m is not None
            else f"Hm0 {format_number(4.0 * self.rms)} m"
        )
        return (
            f"{height}, {format_number(self.low_hz)} .. {format_number(self.high_hz)} Hz, "
            f"realisation {self.realisation}, repeats after {format_number(self.repeat_s)} s"
        )


class PinkSea(BandSea):
    """A sea for identification: amplitudes proportional to f^exponent, phases of a single draw."""

    kind: Literal["pink"]
    exponent: float = Field(default=-0.5, ge=-3, le=0)  # of the frequency in the amplitudes

    def description(self) -> str:
        """Return one line of text."""
        return f"pink, amplitude ~ f^{format_number(self.exponent)}, {self.band_description()}"


class MultisineSea(BandSea):
    """A sea for identification whose phases have the least peak-to-peak value of many draws."""

    kind: Literal["multisine"]
    colour: Literal["flat", "pink"] = "flat"  # of the amplitudes over frequency
    draws: WholeNumber = Field(default=100, ge=1, le=1000)
    """Number of draws of the phases, of which the best is kept."""

    @property
    def exponent(self) -> float:
        """Exponent of the amplitudes, which are proportional to f^exponent."""
        return -0.5 if self.colour == "pink" else 0.0

    def description(self) -> str:
        """Return one line of text."""
        return f"multisine, {self.colour}, best of {self.draws} draws, {self.band_description()}"


class RecordedSea(FileModel):
    """A measured elevation, played from ``start_s`` to ``end_s`` of its file repeatedly."""

    kind: Literal["recorded"]
    file: str = Field(min_length=1)  # .twe or .csv, relative to this file
    channel: str = Field(min_length=1)  # column of the file
    rate_hz: float | None = Field(default=None, ge=1, le=1000)  # checked against the time column
    start_s: float = Field(ge=0, le=1e6)  # beginning of the part of the record
    end_s: float = Field(gt=0, le=1e6)  # end of the part of the record
    unit: Literal["inch", "m", "mm", "cm"]  # of the record
    repeat_s: float | None = Field(default=None, ge=1, le=3600)
    """Period after which the signal repeats."""

    foreign_keys: ClassVar[dict[str, str]] = {
        "hs_m": "a recorded sea has the height of its record",
        "amplitude_m": "a recorded sea has the height of its record",
    }

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the file's suffix, and that the window holds at least one repeat period."""
        if not self.file.lower().endswith((".twe", ".csv")):
            yield self.violation("file", f"{self.file!r} cannot be read; allowed *.twe, *.csv")
        length = self.end_s - self.start_s
        if length <= 0.0:
            yield self.violation(
                "end_s",
                f"{format_number(self.end_s)} is not after the start; "
                f"allowed above start_s = {format_number(self.start_s)} s",
            )
        elif self.repeat_s is not None and self.repeat_s > length * (1 + 1e-9):
            yield self.violation(
                "repeat_s",
                f"{format_number(self.repeat_s)} is longer than the window; "
                f"allowed up to end_s - start_s = {format_number(length)} s",
            )

    @property
    def repeat(self) -> float:
        """Repeat period, s; the window's length unless the file gives ``repeat_s``."""
        return self.repeat_s if self.repeat_s is not None else self.end_s - self.start_s

    def description(self) -> str:
        """Return one line of text."""
        return (
            f"recorded, {self.channel} of {self.file}, "
            f"{format_number(self.start_s)} .. {format_number(self.end_s)} s, "
            f"repeats after {format_number(self.repeat)} s"
        )


AnySea = CalmSea | RegularSea | JonswapSea | PinkSea | MultisineSea | RecordedSea
Sea = Annotated[AnySea, Field(discriminator="kind")]
