"""Identification of models, fits, families and excitation from runs."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from rig.emulation.bem_impedance import BemImpedance, Water, read_impedance
from rig.identification.bem import Bem, read_bem
from rig.identification.drag import identify_drag
from rig.identification.excitation import Excitation, Sea, excitation, is_same_sea
from rig.identification.experiments import BODY, Experiment, read_experiments
from rig.identification.families import Member, family
from rig.identification.fit import ORDERS, FittedImpedance, fit
from rig.identification.impedances import Model, models
from rig.recording.runs import RunError, RunInfo, run_info
from rig.spectra import wave_calibration

FITTED = ("Z_i", "Z_id")
SIMULATED_ELEVATION = "elevation"  # elevation of a simulated sea at the device's position
MIN_LINES = 4.0  # that carry the energy of a reference, below which a parametric fit says nothing


class IdentificationOptions(NamedTuple):
    """Options of an identification."""

    order: int = 2  # of the parametric models
    probe: str = ""  # probe that measures eta; empty: the simulated elevation
    bem: Bem | None = None  # for comparison
    incomplete_rows: bool = False  # also use rows with missing ticks
    bem_file: Path | None = None  # for comparison with the excitation, if any, and the impedance


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
    bem_impedances: Mapping[str, BemImpedance] = MappingProxyType({})  # by axis


def identify(runs: Sequence[Path], options: IdentificationOptions | None = None) -> Identification:
    """Identify from runs with a reference, in calm water or waves, and from wave calibrations.

    Raises RunError if the runs give no model, ValueError for an invalid order or a BEM file with
    nothing to compare with.
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
    if len({model.rotates for model in identified_models}) > 1:
        raise RunError("some axes rotate, others translate: identify them one by one")
    fits = tuple(_fit_model(model, options.order, notes) for model in identified_models)
    known, path = options.bem, options.bem_file
    if known is None and path is not None and seas:
        known = read_bem(path)
    axes = dict.fromkeys(model.axis for model in identified_models)
    impedances = {} if path is None else _read_impedances(path, axes, run_facts, known, notes)
    return Identification(
        run_facts[0].attributes(),
        tuple(each_facts.run for each_facts in run_facts),
        identified_models,
        fits,
        family(identified_models, experiments),
        _identify_excitations(experiments, seas, identified_models, notes),
        known,
        tuple(notes),
        impedances,
    )


def _read_impedances(
    path: Path,
    axes: Iterable[str],
    run_facts: Sequence[RunInfo],
    known: Bem | None,
    notes: list[str],
) -> dict[str, BemImpedance]:
    """Return the impedance of each axis by a BEM file; a file without it is refused.

    It is noted instead where ``known`` is the excitation to compare with.
    """
    found = {}
    for axis in axes:
        try:
            found[axis] = read_impedance(path, axis, *_mode_of_plant(run_facts[0], axis))
        except ValueError as error:
            if known is None:
                reason = "the runs have no excitation to compare with either"
                raise ValueError(f"{error}; {reason}") from None
            notes.append(str(error))
    return found


def _mode_of_plant(run: RunInfo, axis: str) -> tuple[str, Water]:
    """Return the BEM file's name of the only mode that an axis of a run's plant moves with."""
    plant = run.config.get("plant") or {}

    def number(key: str) -> float | None:
        value = plant.get(key)
        return value.get("value") if isinstance(value, dict) else value

    keys = ("density_kg_per_m3", "gravity_m_per_s2", "depth_m", "length_scale_m")
    own = (plant.get("axes") or {}).get(axis) or {}
    moves_with = own.get("moves_with") or {}
    water = Water(*map(number, keys))
    if len(moves_with) != 1:
        return "", water
    (mode,) = moves_with
    return plant["modes"][mode].get("dof") or "", water


def _no_model_message(runs: Sequence[Path], notes: list[str], experiments: list[Experiment]) -> str:
    run_names = ", ".join(str(run) for run in runs)
    if experiments:
        return f"{run_names}: no rows in calm water, so no impedance to identify"
    reasons = "; ".join(notes) or "no measured row has a reference"
    return f"{run_names}: nothing to identify ({reasons})"


def _fit_model(
    model: Model, order: int, notes: list[str]
) -> dict[str, tuple[FittedImpedance, ...]]:
    fits: dict[str, tuple[FittedImpedance, ...]] = {}
    if not any(np.isfinite(each.band).any() for each in model.responses.values()):
        notes.append(
            f"{model.name}: one period of one realisation gives no band; measure two periods or "
            "realisations"
        )
    if model.effective_lines < MIN_LINES:
        notes.append(
            f"{model.name}: {model.effective_lines:.2g} lines carry the energy of the reference, "
            f"so no model is fitted; allowed from {MIN_LINES:g}: use a multisine over the band"
        )
        return fits
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
            continue
        if apart := _apart(fits[name]):
            notes.append(
                f"{model.name}: {name}: {' and '.join(apart)} of orders 2 and {order} differ by "
                "more than their intervals: they depend on the form of the fit, so use the response"
            )
    return fits


def _apart(fits: tuple[FittedImpedance, ...]) -> list[str]:
    """Return which of M, B and K of the first and the last fit have separate intervals."""
    first, last = fits[0], fits[-1]
    parts = zip("MBK", first[:3], last[:3], first.intervals, last.intervals, strict=True)
    return [name for name, a, b, wide_a, wide_b in parts if abs(a - b) > wide_a + wide_b]


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
