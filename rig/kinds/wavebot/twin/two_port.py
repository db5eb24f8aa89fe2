"""Two-port of a device measured in a run, and its pictures."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.design.twoport.network import Motor, linear_drivetrain
from rig.design.twoport.pictures import Case, transfers, vary, write_effects, write_transfer
from rig.identification.identify import Identification
from rig.identification.impedances import Model
from rig.identification.periods import Complexes, Floats
from rig.kinds.wavebot.twin.electrics import RESISTANCE, identify_winding
from rig.kinds.wavebot.twin.records import Record
from rig.recording.runs import RunError
from rig.recording.runs.folder import RunInfo

MOTOR = Motor(6.1745, 12.4666, 0.5)
"""The heave motor (public fbWecCntrl repository, demo_waveBot.m)."""


class MeasuredDevice(NamedTuple):
    """Measured quantities of a device that the theory needs."""

    model: str  # name of the identified model
    attributes: dict[str, Any]  # run id and mode
    spring_rate: float  # N/m, of the measured rows
    omega: Floats
    z_i: Complexes  # N s/m
    drivetrain: Complexes  # N s/m, without the magnetic spring
    motor: Motor


class VariationOptions(NamedTuple):
    """The base setting, and the step of each parameter in both directions."""

    kp: float = -2500.0  # N s/m
    ki: float = 0.0  # N/m
    spring_rate: float | None = None  # N/m; None: that of the measured rows
    kp_step: float = 1000.0
    ki_step: float = 4000.0
    spring_step: float = 5000.0
    gear_step: float = 0.25  # share of the gear ratio


def device_from_run(
    identification: Identification, run_facts: RunInfo, records: tuple[Record, ...]
) -> MeasuredDevice:
    """Return the device of the heave model with the largest amplitude.

    Raises RunError without a model that has Z_i and Z_d.
    """
    models = [
        one for one in identification.models if one.axis == "heave" and "Z_d" in one.responses
    ]
    if not models:
        raise RunError(f"{run_facts.run}: no model of heave with Z_i and Z_d")
    model: Model = max(models, key=lambda one: one.peak)
    torque = run_facts.config_number("rig", "heave", "torque_constant_n_m_per_a")
    gear = run_facts.config_number("rig", "heave", "gear_ratio_rad_per_m")
    if torque is None or gear is None:
        raise RunError(f"{run_facts.run}: its configuration has no torque constant or gear ratio")
    resistance = identify_winding(records).by_name[RESISTANCE]
    spring = linear_drivetrain(model.omega, 0.0, 0.0, model.spring_rate)
    return MeasuredDevice(
        model.name,
        identification.attributes,
        model.spring_rate,
        model.omega,
        model.responses["Z_i"].value,
        model.responses["Z_d"].value - spring,
        Motor(torque, gear, resistance),
    )


def write_pictures(device: MeasuredDevice, steps: VariationOptions, folder: Path) -> list[Path]:
    """Draw the effects of gains, spring and gear, and power transfer with mismatch."""
    folder.mkdir(parents=True, exist_ok=True)
    spring_rate = device.spring_rate if steps.spring_rate is None else steps.spring_rate
    base = Case("base", steps.kp, steps.ki, spring_rate, device.motor.gear)
    description = f"Kp {base.kp:g} N s/m, Ki {base.ki:g} N/m, spring {base.spring_rate:g} N/m"
    variations = {
        "gains": {"kp": steps.kp_step, "ki": steps.ki_step},
        "spring_gear": {
            "spring_rate": steps.spring_step, "gear": steps.gear_step * device.motor.gear,
        },
    }  # fmt: skip
    parts = (device.omega, device.z_i, device.drivetrain, device.motor)
    written = [
        write_effects(
            folder / f"twoport_{name}.png", *parts, vary(base, **steps_of_figure),
            f"Effect of {' and '.join(name.split('_'))} around {description}", device.attributes,
        )
        for name, steps_of_figure in variations.items()
    ]  # fmt: skip
    cases = [*vary(base, kp=steps.kp_step, ki=steps.ki_step)]
    power_transfers = transfers(*parts, cases)
    path = folder / "twoport_transfer.png"
    title = f"Power transfer around {description}"
    return [*written, write_transfer(path, device.omega, power_transfers, title, device.attributes)]
