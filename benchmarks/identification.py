"""How near an identification comes to the plant, from full rehearsals; and how long it takes."""

import math
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from ruamel.yaml import YAML

from benchmarks.support.result import Figure, Result, figure
from rig.config.yaml_source import load_mapping
from rig.execution.campaign import run_campaign
from rig.identification import bem as bem_file
from rig.identification.excitation import Excitation
from rig.identification.experiments import GAINS, Experiment
from rig.identification.identify import Identification, IdentificationOptions, identify
from rig.identification.impedances import models
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.tasks import rehearsal_mode

CONFIGS = Path(__file__).resolve().parents[1] / "configs"
BEM = CONFIGS / "plants" / "wavebot_bem.npz"
LINEAR = CONFIGS / "plants" / "wavebot_linear.yaml"
RIG = CONFIGS / "plants" / "wavebot.yaml"  # with friction, drag and the spring's own curve
SPRINGS = (490.9, -5715.0, 5873.0)
PERCENT = 100.0
LOW_FREQUENCY = 0.7  # Hz


class _Silent:
    notice = ""

    def __call__(self, snapshot: Any) -> None:
        """Draw nothing."""


class Scale(NamedTuple):
    """How long the rehearsals are."""

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
        found = [identify([run]) for run in calm]
        began = time.monotonic()
        whole = identify([calm[0], *waves, *seas], IdentificationOptions(bem=bem))
        took = time.monotonic() - began
        pushed = [_rehearse(folder, "family", _family(scale))]
        dragged = [_rehearse(folder, f"dragged_{i}", _waves(scale, i, RIG)) for i in scale.seas]
        alone = [
            _rehearse(folder, f"dragged_sea_{i}", _device_absent(scale, i, RIG)) for i in scale.seas
        ]
        nonlinear = identify([*pushed, *dragged, *alone], IdentificationOptions(bem=bem))
        once = [_rehearse(folder, "once", _single_row(scale))]
        untold = identify([*once, *dragged, *alone], IdentificationOptions(bem=bem))
    return Result(
        "identification",
        "impedances and wave excitation of the simulated rig, from full rehearsals",
        f"{len(found)} rehearsals in calm water and {len(waves)} seas of two realisations, "
        f"repeat period {scale.repeat:g} s",
        (
            *_impedance_figures(found),
            *_excitation_figures(whole.excitations[0], bem),
            *_family_figures(nonlinear),
            *_drag_removed_figures(nonlinear.excitations[0], bem),
            *_drag_in_impedance_figures(untold.excitations[0], bem),
            figure("lines within the 95 % band", "%", _coverage(scale.trials)),
            figure("identification of all runs of the excitation", "s", took),
        ),
    )


def _rehearse(folder: Path, name: str, keys: dict[str, Any]) -> Path:
    path = folder / f"{name}.yaml"
    whole = {"name": name, "rig": str(CONFIGS / "rigs" / "wavebot.yaml"), **keys}
    with path.open("w") as file:
        YAML(typ="safe").dump(whole, file)
    report = check_campaign(path)
    if report.campaign is None or report.plan is None:
        raise RuntimeError(report.text())
    ended = run_campaign(
        report.campaign,
        report.plan,
        folder / "runs",
        _Silent(),
        rehearsal_mode(report.campaign, real_clock=False),
    )
    if ended.outcome.status != "complete":
        raise RuntimeError(f"{name}: {ended.outcome.reason}")
    return ended.folder


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
    told = {"sea": _sea(scale, number), "device": "absent", "timing": {"periods": 2}}
    return {**told, "plant": str(plant), "start": start}


def closed_form(frequency: Any, spring: float) -> dict[str, Any]:
    """Z_i and Z_id of the linear plant (N*s/m) from the numbers of its file."""
    plant, _ = load_mapping(LINEAR)
    hull, s = plant["body"], 2j * np.pi * frequency
    top = np.polyval([*hull["radiation"]["numerator"]["value"], 0.0], s)
    radiation = top / np.polyval([1.0, *hull["radiation"]["denominator"]["value"]], s)
    mass = hull["mass"]["value"] + hull["added_mass_infinite"]["value"]
    viscous, stiffness = hull["viscous_linear"]["value"], hull["hydrostatic"]["value"]
    z = mass * s + viscous + radiation + stiffness / s
    return {"Z_i": z, "Z_id": z + plant["pto"]["drivetrain_viscous"]["value"] + spring / s}


def _impedance_figures(found: list[Identification]) -> list[Figure]:
    made = []
    for name in ("Z_i", "Z_id"):
        worst = []
        for each in found:
            (model,) = each.models
            true = closed_form(model.frequency, model.spring_rate)[name]
            off = np.abs(model.responses[name].value / true - 1.0)
            worst.append(PERCENT * float(off.max()))
        title = f"{name}, worst line against closed form"
        made.append(figure(title, "%", worst, at_most=1.0, criterion="worst"))
    return made


def _excitation_figures(one: Excitation, bem: bem_file.Bem) -> list[Figure]:
    off = np.abs(one.value / bem_file.excitation_at(bem, one.frequency) - 1.0)[one.good]
    return [
        figure("excitation, worst good line against BEM", "%", PERCENT * off.max(), at_most=3.0),
        figure("  median of the good lines", "%", PERCENT * float(np.median(off))),
        figure("  lines that are good", "%", PERCENT * float(one.good.mean())),
    ]


def _drag_removed_figures(one: Excitation, bem: bem_file.Bem) -> list[Figure]:
    """Drag is taken out line by line: what of it stays would grow with frequency."""
    low, high = _worst_errors(one, bem)
    title = "with drag and friction: excitation, worst good line"
    return [
        figure(f"{title} up to {LOW_FREQUENCY:g} Hz", "%", low, at_most=3.0),
        figure(f"{title} above", "%", high, at_most=3.0),
        figure("  drag that was taken out", "N*s^2/m^2", one.drag),
    ]


def _drag_in_impedance_figures(one: Excitation, bem: bem_file.Bem) -> list[Figure]:
    """What it is where calm water was pushed only once, as eq. 3.3 of the report stands."""
    if one.drag:
        raise RuntimeError("one row in calm water gave a drag")
    low, high = _worst_errors(one, bem)
    title = "  with the drag left in Z_i: worst good line"
    return [
        figure(f"{title} up to {LOW_FREQUENCY:g} Hz", "%", low),
        figure(f"{title} above", "%", high),
    ]


def _worst_errors(one: Excitation, bem: bem_file.Bem) -> tuple[float, float]:
    """Largest difference from BEM (%) of the good lines up to `SLOW` and above."""
    off = PERCENT * np.abs(one.value / bem_file.excitation_at(bem, one.frequency) - 1.0)
    low = one.frequency <= LOW_FREQUENCY
    return float(off[one.good & low].max()), float(off[one.good & ~low].max())


def _family_figures(found: Identification) -> list[Figure]:
    """Fig. 4-8 of the MASK4 report (Sandia): static friction weighs more where motion is small."""
    damping = [member.drivetrain_damping for member in found.family]
    falling = math.copysign(1.0, min(-np.diff(damping)))
    told = [
        figure(f"effective drivetrain damping at {member.peak_a:.0f} A", "N*s/m", value)
        for member, value in zip(found.family, damping, strict=True)
    ]
    return [*told, figure("  falls with amplitude (1: yes)", "1", falling, at_least=1.0)]


def _coverage(trials: int) -> list[float]:
    """Share of lines whose band holds the truth, on periods made in the frequency domain, %."""
    number = np.arange(1, 26)
    frequency, excited = number / 20.0, (number >= 4) & (number <= 20)
    true = closed_form(frequency, 0.0)["Z_i"]
    rng = np.random.default_rng(11)

    def noisy(values: Any) -> Any:
        size = 0.02 * np.sqrt(np.mean(np.abs(values[excited]) ** 2) / 2.0)
        pair = rng.normal(size=(2, 2, number.size))
        return values + size * (pair[0] + 1j * pair[1])

    def one(realisation: int) -> Experiment:
        phase = rng.uniform(0.0, 2.0 * np.pi, number.size)
        force = np.where(excited, 100.0 * np.exp(1j * phase), 0.0)
        channels = {"velocity": noisy(force / true), "trs": noisy(force), "lcb": noisy(force)}
        return Experiment(
            "paper", realisation, "heave", 0.0, (0.0,) * len(GAINS), realisation, 1.0, 1.0, 20.0,
            tuple(number.tolist()), force, excited, channels, None,
        )  # fmt: skip

    shares = []
    for _ in range(trials):
        (model,) = models([one(1), one(2)])
        found = model.responses["Z_i"]
        inside = np.abs(found.value - true[excited]) <= found.noise
        shares.append(PERCENT * float(inside.mean()))
    return [float(np.mean(part)) for part in np.array_split(np.array(shares), 4)]
