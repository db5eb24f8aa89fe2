"""Which frequency responses a set of experiments gives, and what they are called.

With forces on the body and velocity v (MASK4 report (Sandia), sections 2 and 4.2):

    Z_i  = F_LCB / v            intrinsic impedance: what the column load cell sees is the hull
    Z_id = F_TRS / v            hull and drivetrain in series: what the shaft torque sensor sees
    Z_d  = Z_id - Z_i           the drivetrain, with the magnetic spring
    Y_i  = 1/Z_i,  Y_id = v/F   of command, of current and of the torque sensor

The published scripts store the quotient Z_id/Z_i under the drivetrain's name. It has no unit and is
no impedance; it is only made here to compare with their file. Surge has no load cell between drive
and hull: there Z_id of the current is all there is.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rig.identification import frf
from rig.identification.experiments import COMMAND, CURRENT, LCB, TRS, VELOCITY, Experiment
from rig.identification.frf import Channel, Response
from rig.identification.periods import Complexes, Flags, Floats

ALIKE = 0.02  # of the peak: experiments nearer than this have one amplitude
SAME = 1e-6  # of a reference: nearer than this it is the same realisation


class Model(NamedTuple):
    """One linear model: responses at one spring rate, with one set of gains, at one amplitude."""

    axis: str
    spring_rate: float  # N/m
    gains: tuple[float, ...]  # `experiments.GAINS`
    peak: float  # N, of the reference
    peak_a: float  # A
    realisations: int
    periods: int  # in all
    places: tuple[str, ...]  # runs and rows
    frequency: Floats  # Hz, excited lines
    responses: dict[str, Response]

    @property
    def name(self) -> str:
        """Amplitude and spring rate, as a key."""
        return f"{self.axis} {self.spring_rate:g} N/m {self.peak_a:.3g} A"

    @property
    def omega(self) -> Floats:
        """rad/s of each line."""
        return 2.0 * np.pi * self.frequency


def models(experiments: Iterable[Experiment]) -> tuple[Model, ...]:
    """A model of each set of experiments in calm water that differ in their phases only."""
    calm = [one for one in experiments if one.sea is None]
    groups: list[list[Experiment]] = []
    for one in sorted(calm, key=lambda e: (e.axis, e.spring_rate, e.gains, e.period, e.peak)):
        if not groups or not _alike(groups[-1][0], one):
            groups.append([])
        groups[-1].append(one)
    return tuple(_model(group) for group in groups)


def ratio(model: Model) -> Complexes | None:
    """Z_id/Z_i, only to compare with the published file; None where one of them is not known."""
    if not {"Z_i", "Z_id"} <= model.responses.keys():
        return None
    return model.responses["Z_id"].value / model.responses["Z_i"].value


def combined(
    group: Sequence[Experiment],
) -> tuple[list[Complexes], dict[str, Channel]]:
    """References and channels by realisation; one that was run again has more periods."""
    references: list[Complexes] = []
    pieces: list[dict[str, list[Complexes]]] = []
    for one in group:
        size = np.abs(one.reference).max()
        place = next(
            (i for i, r in enumerate(references) if np.abs(r - one.reference).max() < SAME * size),
            len(references),
        )
        if place == len(references):
            references.append(one.reference)
            pieces.append({})
        for name, lines in one.channels.items():
            pieces[place].setdefault(name, []).append(lines)
    names = set.intersection(*(set(each) for each in pieces))
    whole = {name: Channel(tuple(np.concatenate(each[name]) for each in pieces)) for name in names}
    return references, whole


def _alike(one: Experiment, other: Experiment) -> bool:
    return (
        (one.axis, one.spring_rate, one.gains) == (other.axis, other.spring_rate, other.gains)
        and (one.period, one.lines) == (other.period, other.lines)
        and bool(np.array_equal(one.excited, other.excited))
        and abs(other.peak - one.peak) < ALIKE * one.peak
    )


def _model(group: list[Experiment]) -> Model:
    first = group[0]
    references, channels = combined(group)
    used: Flags = first.excited
    velocity = channels[VELOCITY]

    def of(above: Channel, below: Channel) -> Response:
        return frf.response(above, below, references).at(used)

    responses: dict[str, Response] = {}
    series = TRS if TRS in channels else CURRENT
    if LCB in channels:
        responses["Z_i"] = of(channels[LCB], velocity)
        responses["Z_id"] = of(channels[series], velocity)
        responses["Z_d"] = of(channels[series].minus(channels[LCB]), velocity)
        responses["Y_i"] = of(velocity, channels[LCB])
    else:
        responses["Z_id"] = of(channels[series], velocity)
    for name, channel in ((COMMAND, COMMAND), (CURRENT, CURRENT), ("trs", TRS)):
        if channel in channels:
            responses[f"Y_id_{name}"] = of(velocity, channels[channel])
    return Model(
        first.axis,
        first.spring_rate,
        first.gains,
        first.peak,
        first.peak_a,
        len(references),
        sum(len(z) for z in velocity.realisations),
        tuple(one.place for one in group),
        first.frequency[used],
        responses,
    )
