"""The two-port of a device as a run has measured it, and its pictures."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.design.twoport.figures import Case, around, write_effects
from rig.design.twoport.network import Motor, linear_drivetrain
from rig.design.twoport.transfer import transfers, write_transfer
from rig.identification.identify import Identification
from rig.identification.impedances import Model
from rig.identification.periods import Complexes, Floats
from rig.identification.twin.electrics import RESISTANCE, winding
from rig.identification.twin.records import Record
from rig.recording.runs import RunError
from rig.recording.runs.folder import RunInfo


class Measured(NamedTuple):
    """What the theory needs of a device."""

    model: str  # which it is of
    attributes: dict[str, Any]  # of the run: id and mode
    spring_rate: float  # N/m, of the rows it was measured in
    omega: Floats
    z_i: Complexes  # N s/m
    drivetrain: Complexes  # N s/m, without the magnetic spring
    motor: Motor


class Steps(NamedTuple):
    """The setting that is looked at, and how far each is moved either way."""

    kp: float = -2500.0  # N s/m
    ki: float = 0.0  # N/m
    spring_rate: float | None = None  # N/m; None: that of the rows
    kp_step: float = 1000.0
    ki_step: float = 4000.0
    spring_step: float = 5000.0
    gear_step: float = 0.25  # share of the gear ratio


def measured(found: Identification, known: RunInfo, records: tuple[Record, ...]) -> Measured:
    """Of the heave model of largest amplitude; RunError where there is none with Z_i and Z_d."""
    models = [one for one in found.models if one.axis == "heave" and "Z_d" in one.responses]
    if not models:
        raise RunError(f"{known.run}: no model of heave with Z_i and Z_d")
    model: Model = max(models, key=lambda one: one.peak)
    torque = known.config_number("rig", "heave", "torque_constant_n_m_per_a")
    gear = known.config_number("rig", "heave", "gear_ratio_rad_per_m")
    if torque is None or gear is None:
        raise RunError(f"{known.run}: its configuration does not say motor and gear")
    resistance = winding(records).known[RESISTANCE]
    spring = linear_drivetrain(model.omega, 0.0, 0.0, model.spring_rate)
    return Measured(
        model.name,
        found.attributes,
        model.spring_rate,
        model.omega,
        model.responses["Z_i"].value,
        model.responses["Z_d"].value - spring,
        Motor(torque, gear, resistance),
    )


def write_pictures(device: Measured, steps: Steps, folder: Path) -> list[Path]:
    """Effect of gains, effect of spring and gear, power transfer and mismatch."""
    folder.mkdir(parents=True, exist_ok=True)
    rate = device.spring_rate if steps.spring_rate is None else steps.spring_rate
    base = Case("base", steps.kp, steps.ki, rate, device.motor.gear)
    told = f"Kp {base.kp:g} N s/m, Ki {base.ki:g} N/m, spring {base.spring_rate:g} N/m"
    sets = {
        "gains": {"kp": steps.kp_step, "ki": steps.ki_step},
        "spring_gear": {
            "spring_rate": steps.spring_step, "gear": steps.gear_step * device.motor.gear,
        },
    }  # fmt: skip
    parts = (device.omega, device.z_i, device.drivetrain, device.motor)
    written = [
        write_effects(
            folder / f"twoport_{name}.png", *parts, around(base, **moved),
            f"What {' and '.join(name.split('_'))} move, around {told}", device.attributes,
        )
        for name, moved in sets.items()
    ]  # fmt: skip
    cases = [*around(base, kp=steps.kp_step, ki=steps.ki_step)]
    shares = transfers(*parts, cases)
    path = folder / "twoport_transfer.png"
    title = f"Power transfer around {told}"
    return [*written, write_transfer(path, device.omega, shares, title, device.attributes)]
