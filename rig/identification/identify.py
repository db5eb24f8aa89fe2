"""From runs to everything that is identified from them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.analysis import wave_calibration
from rig.identification.bem import Bem
from rig.identification.drag import drag_of
from rig.identification.excitation import Excitation, Sea, excitation, same_sea
from rig.identification.experiments import Experiment, experiments
from rig.identification.families import Member, family
from rig.identification.fit import Fitted, fit
from rig.identification.impedances import Model, models
from rig.recording.runs import RunError
from rig.recording.runs.folder import run_info

FITTED = ("Z_i", "Z_id")
TRUTH = "elevation"  # of a simulated sea at the device's place


class IdentificationOptions(NamedTuple):
    """What is to be identified, beyond what the runs hold."""

    order: int = 2  # of the parametric models
    probe: str = ""  # whose elevation is eta; the simulated truth if empty
    bem: Bem | None = None  # to compare with
    incomplete_rows: bool = False  # also rows of which the record lacks ticks


class Identification(NamedTuple):
    """All that was identified."""

    attributes: dict[str, Any]  # run, mode, campaign as of the first run
    runs: tuple[str, ...]
    models: tuple[Model, ...]
    fits: tuple[dict[str, tuple[Fitted, ...]], ...]  # by model: second order first, then `order`
    family: tuple[Member, ...]
    excitations: tuple[Excitation, ...]
    bem: Bem | None
    notes: tuple[str, ...]  # what was left out or is to be doubted, and why


def identify(runs: Sequence[Path], asked: IdentificationOptions | None = None) -> Identification:
    """Identify from runs with a reference, in calm water or waves, and from wave calibrations.

    Raises RunError where no model can be made of them, ValueError for an order that is none.
    """
    asked = IdentificationOptions() if asked is None else asked
    notes: list[str] = []
    found: list[Experiment] = []
    seas: list[Sea] = []
    known = [run_info(run) for run in runs]
    for run, what in zip(runs, known, strict=True):
        if wave_calibration.is_calibration(what.plan):
            seas.append(_sea(run, asked, notes))
            continue
        read = experiments(run, incomplete_rows=asked.incomplete_rows)
        found += read.experiments
        notes += read.notes
    made = models(found)
    if not made:
        raise RunError(_nothing(runs, notes, found))
    fits = tuple(_fits(one, asked.order, notes) for one in made)
    return Identification(
        known[0].attributes(),
        tuple(what.run for what in known),
        made,
        fits,
        family(made, found),
        _excitations(found, seas, made, notes),
        asked.bem,
        tuple(notes),
    )


def _nothing(runs: Sequence[Path], notes: list[str], found: list[Experiment]) -> str:
    named = ", ".join(str(run) for run in runs)
    if found:
        return f"{named}: no rows in calm water, so no impedance to identify"
    told = "; ".join(notes) or "they hold no measured row with a reference"
    return f"{named}: nothing to identify ({told})"


def _fits(model: Model, order: int, notes: list[str]) -> dict[str, tuple[Fitted, ...]]:
    made = {}
    for name in FITTED:
        if name not in model.responses:
            continue
        z = model.responses[name].value
        orders = (2,) if order == 2 else (2, order)
        try:
            made[name] = tuple(fit(model.frequency, z, each) for each in orders)
        except ValueError as error:
            if order not in (2, 4, 6, 8):
                raise
            notes.append(f"{model.name}: {name}: {error}")
    return made


def _sea(run: Path, asked: IdentificationOptions, notes: list[str]) -> Sea:
    """The elevation that a wave calibration found."""
    table = wave_calibration.calibrate_waves(run, incomplete_rows=asked.incomplete_rows)
    if withheld := table.attrs.get("withheld"):
        notes.append(f"{table.attrs['run']}: {withheld}")
    names = table["probe"].values.tolist()
    name = asked.probe or TRUTH
    if name not in names:
        raise RunError(
            f"{run}: no {name!r} in this wave calibration; say which probe stands where the "
            f"device is to be: --probe {' | '.join(names)}"
        )
    one = table.sel(probe=name)
    size, phase = one["amplitude"].values, one["phase"].values
    return Sea(
        str(table.attrs.get("run", run.name)),
        name,
        float(table.attrs["repeat_s"]),
        tuple(int(k) for k in table["cycles"].values),
        np.asarray(size * np.exp(1j * phase), dtype=np.complex128),
        np.asarray(one["weak"].values == 1, dtype=np.bool_),
        (
            tuple(table["asked_amplitude"].values.tolist()),
            tuple(table["asked_phase"].values.tolist()),
        ),
    )


def _excitations(
    found: Sequence[Experiment], seas: Sequence[Sea], made: Sequence[Model], notes: list[str]
) -> tuple[Excitation, ...]:
    """One excitation for each spring rate at which there were waves."""
    pairs: dict[float, list[tuple[Experiment, Sea]]] = {}
    for one in (each for each in found if each.sea is not None):
        if one.axis != "heave":
            notes.append(f"{one.place}: no load cell between drive and hull in {one.axis}")
            continue
        sea = next((each for each in seas if same_sea(one, each)), None)
        if sea is None:
            notes.append(
                f"{one.place}: no wave calibration (device: absent) of its sea among the runs; "
                "probes of the run itself see what the device radiates and are refused as eta"
            )
            continue
        pairs.setdefault(one.spring_rate, []).append((one, sea))
    out, drag = [], drag_of(found) if pairs else None
    for rate, matched in pairs.items():
        model = _nearest(made, matched[0][0])
        if model is None:
            notes.append(f"waves at {rate:g} N/m: no intrinsic impedance from calm water")
            continue
        try:
            out.append(excitation([e for e, _ in matched], [s for _, s in matched], model, drag))
        except ValueError as error:
            notes.append(f"waves at {rate:g} N/m: {error}")
    return tuple(out)


def _nearest(made: Sequence[Model], one: Experiment) -> Model | None:
    """The model with Z_i of the nearest spring rate, and of those the nearest amplitude."""
    there = [each for each in made if each.axis == one.axis and "Z_i" in each.responses]
    return min(
        there,
        key=lambda m: (abs(m.spring_rate - one.spring_rate), abs(m.peak - one.peak)),
        default=None,
    )
