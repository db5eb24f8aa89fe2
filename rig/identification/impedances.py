"""Impedances and admittances of sets of experiments.

With forces on the body and velocity v (MASK4 report (Sandia), sections 2 and 4.2):

    Z_i  = F_body / v           intrinsic impedance: the hull, seen by the sensor at the body
    Z_id = F_drive / v          hull and drivetrain in series, seen by the drive's best sensor
    Z_d  = Z_id - Z_i           the drivetrain, with the magnetic spring
    Y_i  = 1/Z_i,  Y_id = v/F   of command, of current and of each sensor of the drive

The published scripts store the quotient Z_id/Z_i under the drivetrain's name. It is dimensionless
and not an impedance; `ratio` exists only for comparison with their file. Without a sensor between
drive and body only Z_id is available; where the drive acts on the body directly, only Z_i.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rig.identification import frf
from rig.identification.axis_units import LINEAR, ROTARY, AxisUnits
from rig.identification.experiments import BODY, SECOND, VELOCITY, Experiment
from rig.identification.frf import Channel, Response
from rig.spectra.periods import Complexes, Flags, Floats

PEAK_TOLERANCE = 0.02  # relative difference of peaks up to which experiments have one amplitude
REFERENCE_TOLERANCE = 1e-6  # relative difference of references up to which they are one realisation


class Model(NamedTuple):
    """One linear model: responses at one spring rate, with one set of gains, at one amplitude."""

    axis: str
    spring_rate: float  # N/m
    gains: tuple[float, ...]  # of feedback
    peak: float  # N, of the reference
    peak_a: float  # A
    realisations: int
    periods: int  # total
    row_labels: tuple[str, ...]  # runs and rows
    frequency: Floats  # Hz, excited lines
    responses: dict[str, Response]
    labels: Mapping[str, str]  # of `experiments.BODY` and of the forces in the names Y_id_<name>
    rotates: bool = False
    effective_lines: float = np.nan
    """Lines that carry the energy of the reference: its square over the sum of the lines' squares.
    """
    sprung: bool = True  # the drivetrain has a spring, whose rate is known

    @property
    def units(self) -> AxisUnits:
        """Units of the axis."""
        return ROTARY if self.rotates else LINEAR

    @property
    def name(self) -> str:
        """Axis, spring rate of a drivetrain with a spring, and amplitude, as a key."""
        spring = f" {self.spring_rate:g} {self.units.stiffness}" if self.sprung else ""
        return f"{self.axis}{spring} {self.peak_a:.3g} A"

    @property
    def has_drivetrain(self) -> bool:
        """Return whether Z_d is known and differs from 0 by more than its band, median of lines."""
        response = self.responses.get("Z_d")
        if response is None:
            return False
        known = np.isfinite(response.band)
        ratio_to_band = np.abs(response.value[known]) / response.band[known]
        return not known.any() or bool(np.median(ratio_to_band) > 1.0)

    @property
    def omega(self) -> Floats:
        """Angular frequency of each line, rad/s."""
        return 2.0 * np.pi * self.frequency


def models(experiments: Iterable[Experiment]) -> tuple[Model, ...]:
    """Return a model of each set of calm-water experiments that differ only in phases."""
    calm = [experiment for experiment in experiments if experiment.sea is None]
    groups: list[list[Experiment]] = []
    for experiment in sorted(
        calm, key=lambda e: (e.axis, e.spring_rate, e.gains, e.period, e.peak)
    ):
        if not groups or not _differ_in_phase_only(groups[-1][0], experiment):
            groups.append([])
        groups[-1].append(experiment)
    return tuple(_build_model(group) for group in groups)


def ratio(model: Model) -> Complexes | None:
    """Return Z_id/Z_i, for comparison with the published file; None if one of them is missing."""
    if not {"Z_i", "Z_id"} <= model.responses.keys():
        return None
    return model.responses["Z_id"].value / model.responses["Z_i"].value


def interpolate_impedance(frequency: Floats, z: Complexes, at: Floats) -> tuple[Complexes, Flags]:
    """Return Z interpolated at frequencies (Hz), and True where they are within its range.

    Im Z varies as 1/omega, so omega Im Z is interpolated linearly.
    """
    imaginary = np.interp(at, frequency, z.imag * frequency) / at
    value = np.interp(at, frequency, z.real) + 1j * imaginary
    tolerance = 1e-9
    inside = (at >= frequency[0] * (1 - tolerance)) & (at <= frequency[-1] * (1 + tolerance))
    return np.asarray(value, dtype=np.complex128), inside


def combine_realisations(
    group: Sequence[Experiment],
) -> tuple[list[Complexes], dict[str, Channel]]:
    """Return references and channels by realisation; a repeated realisation has more periods."""
    references: list[Complexes] = []
    blocks: list[dict[str, list[Complexes]]] = []
    rounding: list[list[Floats]] = []
    for experiment in group:
        tolerance = REFERENCE_TOLERANCE * np.abs(experiment.reference).max()
        known = [np.abs(r - experiment.reference).max() < tolerance for r in references]
        index = known.index(True) if True in known else len(references)
        if index == len(references):
            references.append(experiment.reference)
            blocks.append({})
            rounding.append([])
        for name, lines in experiment.channels.items():
            blocks[index].setdefault(name, []).append(lines)
        if experiment.rounding is not None:
            rounding[index].append(experiment.rounding)
    names = set.intersection(*(set(block) for block in blocks))
    channels = {
        name: Channel(tuple(np.concatenate(block[name]) for block in blocks)) for name in names
    }
    if all(rounding):  # that of a repeated realisation repeats
        deviations = tuple(np.sqrt(np.mean(np.square(each), axis=0)) for each in rounding)
        channels[VELOCITY] = channels[VELOCITY]._replace(rounding=deviations)
    return references, channels


def _differ_in_phase_only(a: Experiment, b: Experiment) -> bool:
    return (
        (a.axis, a.spring_rate, a.gains) == (b.axis, b.spring_rate, b.gains)
        and (a.period, a.lines) == (b.period, b.lines)
        and bool(np.array_equal(a.excited, b.excited))
        and abs(b.peak - a.peak) < PEAK_TOLERANCE * a.peak
    )


def _build_model(group: list[Experiment]) -> Model:
    first = group[0]
    references, channels = combine_realisations(group)
    excited: Flags = first.excited
    velocity = channels[VELOCITY]

    def compute_response(numerator: Channel, denominator: Channel) -> Response:
        return frf.response(numerator, denominator, references).select(excited)

    responses: dict[str, Response] = {}
    body = channels.get(BODY)
    drive = [
        name for name in first.channels if name in channels and name not in (VELOCITY, BODY, SECOND)
    ]
    if body is not None:
        responses["Z_i"] = compute_response(body, velocity)
    if drive:
        series = channels[drive[-1]]
        responses["Z_id"] = compute_response(series, velocity)
        if body is not None:
            responses["Z_d"] = compute_response(series.minus(body), velocity)
    if body is not None:
        responses["Y_i"] = compute_response(velocity, body)
    for name in drive:
        responses[f"Y_id_{name}"] = compute_response(velocity, channels[name])
    if SECOND in channels:
        checked = "Z_id" if drive else "Z_i"
        second = compute_response(channels[SECOND], velocity)
        responses[checked] = responses[checked].compared_with(second)
        if "Z_d" in responses:
            distance = responses[checked].systematic
            responses["Z_d"] = responses["Z_d"]._replace(systematic=distance)
        elif not drive:
            second = compute_response(velocity, channels[SECOND])
            responses["Y_i"] = responses["Y_i"].compared_with(second)
    return Model(
        first.axis,
        first.spring_rate,
        first.gains,
        first.peak,
        first.peak_a,
        len(references),
        sum(len(z) for z in velocity.realisations),
        tuple(experiment.row_label for experiment in group),
        first.frequency[excited],
        responses,
        first.labels,
        first.rotates,
        _effective_lines(first.reference[excited]),
        first.sprung,
    )


def _effective_lines(reference: Complexes) -> float:
    energy = np.abs(reference) ** 2
    return float(energy.sum() ** 2 / np.sum(energy**2))
