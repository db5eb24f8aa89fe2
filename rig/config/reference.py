"""The open-loop reference of a campaign: a periodic force that the laws' feedback is added to.

Amplitudes are drive currents, as the MASK4 test gave them: 10 A is 770 N on the body.
"""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from rig.config.model import Broken, FileModel, Whole
from rig.config.problems import number_text

Amplitude = Annotated[float, Field(gt=0, le=40)]


class SineReference(FileModel):
    """One sine, zero at zero of the wave clock."""

    kind: Literal["sine"]
    amplitude_a: Amplitude
    frequency_hz: float = Field(ge=0.02, le=5)

    def words(self) -> str:
        """The reference in a line."""
        return f"sine, {number_text(self.amplitude_a)} A, {number_text(self.frequency_hz)} Hz"


class MultisineReference(FileModel):
    """All lines k/repeat of a band with random phases, the best of many draws."""

    kind: Literal["multisine"]
    amplitude_a: Amplitude  # greatest magnitude of the whole signal
    low_hz: float = Field(default=0.2, ge=0.01, le=5)
    high_hz: float = Field(default=1.0, ge=0.01, le=5)
    repeat_s: float = Field(default=300.0, ge=1, le=3600)
    colour: Literal["flat", "pink"] = "flat"
    draws: Whole = Field(default=100, ge=1, le=1000)
    seed: Whole | None = Field(default=None, ge=0, le=4_294_967_295)  # the campaign's if missing
    realisation: Whole = Field(default=1, ge=1, le=1000)

    def broken_rules(self) -> Iterator[Broken]:
        """The band has an upper end above its lower one."""
        if self.high_hz <= self.low_hz:
            yield Broken(
                ("high_hz",),
                f"{number_text(self.high_hz)} is not above low_hz = {number_text(self.low_hz)} Hz",
                self.high_hz,
            )

    def words(self) -> str:
        """The reference in a line."""
        return (
            f"multisine, {self.colour}, {number_text(self.amplitude_a)} A at most, "
            f"{number_text(self.low_hz)} .. {number_text(self.high_hz)} Hz, "
            f"repeats after {number_text(self.repeat_s)} s, realisation {self.realisation}"
        )


AnyReference = SineReference | MultisineReference | None
Reference = Annotated[SineReference | MultisineReference, Field(discriminator="kind")]
