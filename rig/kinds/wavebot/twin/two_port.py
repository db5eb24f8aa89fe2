"""Two-port of a device measured in a run, and its pictures."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.config.law_settings import DEFAULT_LAW
from rig.design.twoport.network import Motor, linear_drivetrain
from rig.design.twoport.pictures import Case, TakeOff, vary, write_effects, write_transfer
from rig.identification.identify import identify
from rig.kinds.wavebot.twin.drivetrain import RESISTANCE, identify_winding
from rig.kinds.wavebot.twin.records import read_records
from rig.recording.runs import RunError

MOTOR = Motor(6.1745, 12.4666, 0.5)
"""The heave motor (public fbWecCntrl repository, demo_waveBot.m)."""


class MeasuredDevice(NamedTuple):
    """Measured quantities of a device that the theory needs."""

    model: str  # name of the identified model
    attributes: dict[str, Any]  # run id and mode
    spring_rate: float  # N/m, of the measured rows
    take_off: TakeOff  # its drivetrain is without the magnetic spring


class VariationOptions(NamedTuple):
    """The base setting, and the step of each parameter in both directions."""

    kp: float = -2500.0  # N s/m
    ki: float = 0.0  # N/m
    spring_rate: float | None = None  # N/m; None: that of the measured rows
    kp_step: float = 1000.0
    ki_step: float = 4000.0
    spring_step: float = 5000.0
    gear_step: float = 0.25  # share of the gear ratio


def device_from_run(run: Path) -> MeasuredDevice:
    """Return the device of the heave model with the largest amplitude.

    Raises RunError without a model that has Z_i and Z_d, and for a run of another law than the
    impedance law, whose gains Kp and Ki the pictures vary.
    """
    run_facts, records, _ = read_records(run)
    law = run_facts.config.get("law")  # runs recorded before there was a choice have none
    if isinstance(law, dict) and (law["file"] or law["name"] != DEFAULT_LAW):
        raise RunError(
            f"{run_facts.run}: its law is {law['name']}; the two-port theory needs a run of the "
            f"law {DEFAULT_LAW}, with the gains Kp and Ki"
        )
    identification = identify([run])
    models = (one for one in identification.models if one.axis == "heave")
    model = max((m for m in models if "Z_d" in m.responses), key=lambda m: m.peak, default=None)
    if model is None:
        raise RunError(f"{run_facts.run}: no model of heave with Z_i and Z_d")
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
        TakeOff(
            model.omega,
            model.responses["Z_i"].value,
            model.responses["Z_d"].value - spring,
            Motor(torque, gear, resistance),
        ),
    )


def write_pictures(device: MeasuredDevice, steps: VariationOptions, folder: Path) -> list[Path]:
    """Draw the effects of gains, spring and gear, and power transfer with mismatch."""
    folder.mkdir(parents=True, exist_ok=True)
    spring_rate = device.spring_rate if steps.spring_rate is None else steps.spring_rate
    take_off, gear = device.take_off, device.take_off.motor.gear
    base = Case("base", steps.kp, steps.ki, spring_rate, gear)
    description = f"Kp {base.kp:g} N s/m, Ki {base.ki:g} N/m, spring {base.spring_rate:g} N/m"
    variations = {
        "gains": {"kp": steps.kp_step, "ki": steps.ki_step},
        "spring_gear": {"spring_rate": steps.spring_step, "gear": steps.gear_step * gear},
    }
    written = []
    for name, variation in variations.items():
        path, cases = folder / f"twoport_{name}.png", vary(base, **variation)
        title = f"Effect of {' and '.join(name.split('_'))} around {description}"
        written.append(write_effects(path, take_off, cases, title, device.attributes))
    path, cases = folder / "twoport_transfer.png", vary(base, **variations["gains"])
    title = f"Power transfer around {description}"
    return [*written, write_transfer(path, take_off, cases, title, device.attributes)]
