"""Identification of models, fits, families and excitation from runs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.identification.bem import Bem
from rig.identification.drag import identify_drag
from rig.identification.excitation import Excitation, Sea, excitation, is_same_sea
from rig.identification.experiments import BODY, Experiment, read_experiments
from rig.identification.families import Member, family
from rig.identification.fit import ORDERS, FittedImpedance, fit
from rig.identification.impedances import Model, models
from rig.recording.runs import RunError, run_info
from rig.spectra import wave_calibration

FITTED = ("Z_i", "Z_id")
SIMULATED_ELEVATION = "elevation"  # elevation of a simulated sea at the device's position


class IdentificationOptions(NamedTuple):
    """Options of an identification."""

    order: int = 2  # of the parametric models
    probe: str = ""  # probe that measures eta; empty: the simulated elevation
    bem: Bem | None = None  # for comparison
    incomplete_rows: bool = False  # also use rows with missing ticks


class Identification(NamedTuple):
    """Result of an identification."""

    attributes: dict[str, Any]  # run, mode and campaign of the first run
    runs: tuple[str, ...]
    models: tuple[Model, ...]
    fits: tuple[dict[str, tuple[FittedImpedance, ...]], ...]
    """Fits of each model by response: second order first, then the order of the options."""
    family: tuple[Member, ...]
    excitations: tuple[Excitation, ...]
    bem: Bem | None
    notes: tuple[str, ...]  # excluded or doubtful data, with reasons


def identify(runs: Sequence[Path], options: IdentificationOptions | None = None) -> Identification:
    """Identify from runs with a reference, in calm water or waves, and from wave calibrations.

    Raises RunError if the runs give no model, ValueError for an invalid order.
    """
    options = IdentificationOptions() if options is None else options
    notes: list[str] = []
    experiments: list[Experiment] = []
    seas: list[Sea] = []
    run_facts = [run_info(run) for run in runs]
    for run, each_facts in zip(runs, run_facts, strict=True):
        if wave_calibration.is_calibration(each_facts.plan):
            seas.append(_read_sea(run, options, notes))
            continue
        run_experiments = read_experiments(run, incomplete_rows=options.incomplete_rows)
        experiments += run_experiments.experiments
        notes += run_experiments.notes
    identified_models = models(experiments)
    if not identified_models:
        raise RunError(_no_model_message(runs, notes, experiments))
    fits = tuple(_fit_model(model, options.order, notes) for model in identified_models)
    return Identification(
        run_facts[0].attributes(),
        tuple(each_facts.run for each_facts in run_facts),
        identified_models,
        fits,
        family(identified_models, experiments),
        _identify_excitations(experiments, seas, identified_models, notes),
        options.bem,
        tuple(notes),
    )


def _no_model_message(runs: Sequence[Path], notes: list[str], experiments: list[Experiment]) -> str:
    run_names = ", ".join(str(run) for run in runs)
    if experiments:
        return f"{run_names}: no rows in calm water, so no impedance to identify"
    reasons = "; ".join(notes) or "no measured row has a reference"
    return f"{run_names}: nothing to identify ({reasons})"


def _fit_model(
    model: Model, order: int, notes: list[str]
) -> dict[str, tuple[FittedImpedance, ...]]:
    fits = {}
    for name in FITTED:
        if name not in model.responses:
            continue
        z, orders = model.responses[name].value, (2,) if order == 2 else (2, order)
        try:
            fits[name] = tuple(fit(model.frequency, z, each) for each in orders)
        except ValueError as error:
            if order not in ORDERS:
                raise
            notes.append(f"{model.name}: {name}: {error}")
    return fits


def _read_sea(run: Path, options: IdentificationOptions, notes: list[str]) -> Sea:
    """Return the elevation measured by a wave calibration."""
    table = wave_calibration.calibrate_waves(run, incomplete_rows=options.incomplete_rows)
    if withheld := table.attrs.get("withheld"):
        notes.append(f"{table.attrs['run']}: {withheld}")
    names = table["probe"].values.tolist()
    name = options.probe or SIMULATED_ELEVATION
    if name not in names:
        raise RunError(
            f"{run}: no {name!r} in this wave calibration; name the probe at the position of the "
            f"device: --probe {' | '.join(names)}"
        )
    probe_table = table.sel(probe=name)
    amplitude, phase = probe_table["amplitude"].values, probe_table["phase"].values
    commanded = table["commanded_amplitude"].values, table["commanded_phase"].values
    return Sea(
        str(table.attrs.get("run", run.name)),
        name,
        float(table.attrs["repeat_s"]),
        tuple(int(k) for k in table["cycles"].values),
        np.asarray(amplitude * np.exp(1j * phase), dtype=np.complex128),
        np.asarray(probe_table["weak"].values == 1, dtype=np.bool_),
        (tuple(commanded[0].tolist()), tuple(commanded[1].tolist())),
    )


def _identify_excitations(
    experiments: Sequence[Experiment],
    seas: Sequence[Sea],
    identified_models: Sequence[Model],
    notes: list[str],
) -> tuple[Excitation, ...]:
    """Return one excitation for each spring rate with rows in waves."""
    pairs: dict[float, list[tuple[Experiment, Sea]]] = {}
    for experiment in (each for each in experiments if each.sea is not None):
        if BODY not in experiment.channels:
            notes.append(
                f"{experiment.row_label}: no load cell between drive and hull in {experiment.axis}"
            )
            continue
        sea = next((each for each in seas if is_same_sea(experiment, each)), None)
        if sea is None:
            notes.append(
                f"{experiment.row_label}: no wave calibration (device: absent) of its sea among "
                "the runs; probes of the run itself measure the radiated waves and are refused "
                "as eta"
            )
            continue
        pairs.setdefault(experiment.spring_rate, []).append((experiment, sea))
    excitations, drag = [], identify_drag(experiments) if pairs else None
    for rate, matched in pairs.items():
        model = _nearest_model(identified_models, matched[0][0])
        if model is None:
            notes.append(f"waves at {rate:g} N/m: no intrinsic impedance from calm water")
            continue
        try:
            excitations.append(
                excitation([e for e, _ in matched], [s for _, s in matched], model, drag)
            )
        except ValueError as error:
            notes.append(f"waves at {rate:g} N/m: {error}")
    return tuple(excitations)


def _nearest_model(identified_models: Sequence[Model], experiment: Experiment) -> Model | None:
    """Return the model with Z_i at the nearest spring rate, then the nearest amplitude."""
    candidates = (
        model
        for model in identified_models
        if model.axis == experiment.axis and "Z_i" in model.responses
    )

    def distance(model: Model) -> tuple[float, float]:
        return abs(model.spring_rate - experiment.spring_rate), abs(model.peak - experiment.peak)

    return min(candidates, key=distance, default=None)
