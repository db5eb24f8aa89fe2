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


def write_pictures(
    device: MeasuredDevice, kp: float, ki: float, spring_rate: float | None, folder: Path
) -> list[Path]:
    """Draw the effects of gains, spring and gear, and power transfer with mismatch.

    The gains (N s/m, N/m) and the spring rate (N/m; None: that of the measured rows) are the base
    setting, from which each parameter is changed in both directions.
    """
    folder.mkdir(parents=True, exist_ok=True)
    spring_rate = device.spring_rate if spring_rate is None else spring_rate
    take_off, gear = device.take_off, device.take_off.motor.gear
    base = Case("base", kp, ki, spring_rate, gear)
    description = f"Kp {base.kp:g} N s/m, Ki {base.ki:g} N/m, spring {base.spring_rate:g} N/m"
    variations = {
        "gains": {"kp": 1000.0, "ki": 4000.0},
        "spring_gear": {"spring_rate": 5000.0, "gear": 0.25 * gear},
    }
    written = []
    for name, variation in variations.items():
        path, cases = folder / f"twoport_{name}.png", vary(base, **variation)
        title = f"Effect of {' and '.join(name.split('_'))} around {description}"
        written.append(write_effects(path, take_off, cases, title, device.attributes))
    path, cases = folder / "twoport_transfer.png", vary(base, **variations["gains"])
    title = f"Power transfer around {description}"
    return [*written, write_transfer(path, take_off, cases, title, device.attributes)]
