"""Error of an identification against the plant, from full rehearsals; and its duration."""

import math
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.support.campaigns import rehearse, write_yaml
from benchmarks.support.result import Figure, Result, figure
from rig.config.yaml_source import load_mapping
from rig.identification import bem as bem_file
from rig.identification.excitation import Excitation
from rig.identification.experiments import BODY, Experiment
from rig.identification.identify import Identification, IdentificationOptions, identify
from rig.identification.impedances import models

CONFIGS = Path(__file__).resolve().parents[1] / "configs"
BEM = CONFIGS / "plants" / "wavebot_bem.npz"
LINEAR = CONFIGS / "plants" / "wavebot_linear.yaml"
RIG = CONFIGS / "plants" / "wavebot.yaml"  # with friction, drag and the spring's own curve
SPRINGS = (490.9, -5715.0, 5873.0)
PERCENT = 100.0
LOW_FREQUENCY = 0.7  # Hz


class Scale(NamedTuple):
    """Length and number of the rehearsals."""

    repeat: float  # s
    settle: float  # s
    springs: tuple[float, ...]
    seas: tuple[int, ...]
    trials: int


SHORT = Scale(20.0, 20.0, SPRINGS[:1], (1,), 100)
FULL = Scale(300.0, 30.0, SPRINGS, (1, 2, 3), 400)


def measure(short: bool) -> Result:
    """Rehearse and identify: linear plant against closed form and BEM, families, coverage."""
    scale = SHORT if short else FULL
    bem = bem_file.read_bem(BEM)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        calm = [
            _rehearse(folder, f"calm_{i}", _calm(scale, k)) for i, k in enumerate(scale.springs)
        ]
        waves = [_rehearse(folder, f"waves_{i}", _waves(scale, i)) for i in scale.seas]
        seas = [_rehearse(folder, f"sea_{i}", _device_absent(scale, i)) for i in scale.seas]
        identifications = [identify([run]) for run in calm]
        began = time.monotonic()
        linear = identify([calm[0], *waves, *seas], IdentificationOptions(bem=bem))
        took = time.monotonic() - began
        family = [_rehearse(folder, "family", _family(scale))]
        with_drag = [_rehearse(folder, f"dragged_{i}", _waves(scale, i, RIG)) for i in scale.seas]
        absent = [
            _rehearse(folder, f"dragged_sea_{i}", _device_absent(scale, i, RIG)) for i in scale.seas
        ]
        nonlinear = identify([*family, *with_drag, *absent], IdentificationOptions(bem=bem))
        single = [_rehearse(folder, "once", _single_row(scale))]
        drag_in_impedance = identify([*single, *with_drag, *absent], IdentificationOptions(bem=bem))
    return Result(
        "identification",
        "impedances and wave excitation of the simulated rig, from full rehearsals",
        f"{len(identifications)} rehearsals in calm water and {len(waves)} seas of two "
        f"realisations, repeat period {scale.repeat:g} s",
        (
            *_impedance_figures(identifications),
            *_excitation_figures(linear.excitations[0], bem),
            *_family_figures(nonlinear),
            *_drag_removed_figures(nonlinear.excitations[0], bem),
            *_drag_in_impedance_figures(drag_in_impedance.excitations[0], bem),
            figure("lines within the 95 % band", "%", _coverage(scale.trials)),
            figure("identification of all runs of the excitation", "s", took),
        ),
    )


def _rehearse(folder: Path, name: str, keys: dict[str, Any]) -> Path:
    rig = str(CONFIGS / "rigs" / "wavebot.yaml")
    path = write_yaml(folder / f"{name}.yaml", {"name": name, "rig": rig, **keys})
    run, _ = rehearse(path, folder / "runs")
    return run


def _excited_calm(scale: Scale, amplitude: float) -> dict[str, Any]:
    reference = {"kind": "multisine", "amplitude_a": amplitude, "repeat_s": scale.repeat, "seed": 1}
    timing = {"settle_s": scale.settle, "periods": 2}
    return {"reference": reference, "timing": timing}


def _matrix(spring: float, **more: Any) -> dict[str, Any]:
    grid = {"spring_n_per_m": spring, "kp_n_s_per_m": 0, "ki_n_per_m": 0, "realisation": [1, 2]}
    return {"grid": [{**grid, **more}]}


def _calm(scale: Scale, spring: float) -> dict[str, Any]:
    keys = _excited_calm(scale, 20.0)
    start = {"set_point_s": 0, "lead_in_s": 5}
    matrix = _matrix(spring)
    return {**keys, "plant": str(LINEAR), "sea": {"kind": "calm"}, "start": start, "matrix": matrix}


def _family(scale: Scale) -> dict[str, Any]:
    matrix = _matrix(SPRINGS[0], reference_scale=[1, 2, 3])
    start = {"set_point_s": 0, "lead_in_s": 5}
    keys = {**_excited_calm(scale, 10.0), "plant": str(RIG), "start": start}
    return {**keys, "sea": {"kind": "calm"}, "matrix": matrix}


def _single_row(scale: Scale) -> dict[str, Any]:
    """Return one row in calm water, which cannot separate drag from damping: Z_i contains both."""
    keys = _family(scale)
    matrix = _matrix(SPRINGS[0], reference_scale=2, realisation=1)
    return {**keys, "matrix": matrix}


def _sea(scale: Scale, number: int) -> dict[str, Any]:
    return {
        "kind": "pink",
        "hm0_m": 0.127,
        "repeat_s": scale.repeat,
        "seed": 1,
        "realisation": number,
    }


def _waves(scale: Scale, number: int, plant: Path = LINEAR) -> dict[str, Any]:
    start = {"set_point_s": 0, "lead_in_s": 60}
    keys = {**_excited_calm(scale, 15.0), "plant": str(plant), "start": start}
    return {**keys, "sea": _sea(scale, number), "matrix": _matrix(SPRINGS[0])}


def _device_absent(scale: Scale, number: int, plant: Path = LINEAR) -> dict[str, Any]:
    start = {"set_point_s": 0, "lead_in_s": 60}
    keys = {"sea": _sea(scale, number), "device": "absent", "timing": {"periods": 2}}
    return {**keys, "plant": str(plant), "start": start}


def closed_form(frequency: Any, spring: float) -> dict[str, Any]:
    """Return Z_i and Z_id of the linear plant (N*s/m) from the constants of its file."""
    plant, _ = load_mapping(LINEAR)
    hull, s = plant["body"], 2j * np.pi * frequency
    top = np.polyval([*hull["radiation"]["numerator"]["value"], 0.0], s)
    radiation = top / np.polyval([1.0, *hull["radiation"]["denominator"]["value"]], s)
    mass = hull["mass"]["value"] + hull["added_mass_infinite"]["value"]
    viscous, stiffness = hull["viscous_linear"]["value"], hull["hydrostatic"]["value"]
    z = mass * s + viscous + radiation + stiffness / s
    return {"Z_i": z, "Z_id": z + plant["pto"]["drivetrain_viscous"]["value"] + spring / s}


def _impedance_figures(identifications: list[Identification]) -> list[Figure]:
    figures = []
    for name in ("Z_i", "Z_id"):
        worst = []
        for each in identifications:
            (model,) = each.models
            true = closed_form(model.frequency, model.spring_rate)[name]
            error = np.abs(model.responses[name].value / true - 1.0)
            worst.append(PERCENT * float(error.max()))
        title = f"{name}, worst line against closed form"
        figures.append(figure(title, "%", worst, at_most=1.0, criterion="worst"))
    return figures


def _excitation_figures(excitation: Excitation, bem: bem_file.Bem) -> list[Figure]:
    error = np.abs(excitation.value / bem_file.excitation_at(bem, excitation.frequency) - 1.0)[
        excitation.good
    ]
    return [
        figure("excitation, worst good line against BEM", "%", PERCENT * error.max(), at_most=3.0),
        figure("  median of the good lines", "%", PERCENT * float(np.median(error))),
        figure("  lines that are good", "%", PERCENT * float(excitation.good.mean())),
    ]


def _drag_removed_figures(excitation: Excitation, bem: bem_file.Bem) -> list[Figure]:
    """Return the figures with drag removed line by line; a remainder would grow with frequency."""
    low, high = _worst_errors(excitation, bem)
    title = "with drag and friction: excitation, worst good line"
    return [
        figure(f"{title} up to {LOW_FREQUENCY:g} Hz", "%", low, at_most=3.0),
        figure(f"{title} above", "%", high, at_most=3.0),
        figure("  drag that was taken out", "N*s^2/m^2", excitation.drag),
    ]


def _drag_in_impedance_figures(excitation: Excitation, bem: bem_file.Bem) -> list[Figure]:
    """Return the figures with a single excited row in calm water, as in eq. 3.3 of the report."""
    if excitation.drag:
        raise RuntimeError("a drag was identified from one row in calm water")
    low, high = _worst_errors(excitation, bem)
    title = "  with the drag left in Z_i: worst good line"
    return [
        figure(f"{title} up to {LOW_FREQUENCY:g} Hz", "%", low),
        figure(f"{title} above", "%", high),
    ]


def _worst_errors(excitation: Excitation, bem: bem_file.Bem) -> tuple[float, float]:
    """Largest difference from BEM (%) of the good lines up to `SLOW` and above."""
    error = PERCENT * np.abs(
        excitation.value / bem_file.excitation_at(bem, excitation.frequency) - 1.0
    )
    low = excitation.frequency <= LOW_FREQUENCY
    return float(error[excitation.good & low].max()), float(error[excitation.good & ~low].max())


def _family_figures(identifications: Identification) -> list[Figure]:
    """Return the drivetrain damping by amplitude: friction weighs more in small motions.

    Source: Fig. 4-8 of the MASK4 report (Sandia).
    """
    damping = [member.drivetrain_damping for member in identifications.family]
    falling = math.copysign(1.0, min(-np.diff(damping)))
    figures = [
        figure(f"effective drivetrain damping at {member.peak_a:.0f} A", "N*s/m", value)
        for member, value in zip(identifications.family, damping, strict=True)
    ]
    return [*figures, figure("  falls with amplitude (1: yes)", "1", falling, at_least=1.0)]


def _coverage(trials: int) -> list[float]:
    """Return the share (%) of lines whose band contains the truth.

    The periods are generated in the frequency domain.
    """
    number = np.arange(1, 26)
    frequency, excited = number / 20.0, (number >= 4) & (number <= 20)
    true = closed_form(frequency, 0.0)["Z_i"]
    rng = np.random.default_rng(11)

    def noisy(values: Any) -> Any:
        size = 0.02 * np.sqrt(np.mean(np.abs(values[excited]) ** 2) / 2.0)
        pair = rng.normal(size=(2, 2, number.size))
        return values + size * (pair[0] + 1j * pair[1])

    def experiment(realisation: int) -> Experiment:
        phase = rng.uniform(0.0, 2.0 * np.pi, number.size)
        force = np.where(excited, 100.0 * np.exp(1j * phase), 0.0)
        channels = {"velocity": noisy(force / true), "trs": noisy(force), BODY: noisy(force)}
        return Experiment(
            "paper", realisation, "heave", 0.0, (0.0,) * 5, realisation, 1.0, 1.0, 20.0,
            tuple(number.tolist()), force, excited, channels, None,
        )  # fmt: skip

    shares = []
    for _ in range(trials):
        (model,) = models([experiment(1), experiment(2)])
        identifications = model.responses["Z_i"]
        inside = np.abs(identifications.value - true[excited]) <= identifications.noise
        shares.append(PERCENT * float(inside.mean()))
    return [float(np.mean(part)) for part in np.array_split(np.array(shares), 4)]
