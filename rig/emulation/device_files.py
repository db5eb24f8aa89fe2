"""The device files of emulated drives, and how a drive of a rig file is emulated."""

from collections.abc import Iterable
from pathlib import Path

from drivers.cia402.drive_objects import BY_NAME
from rig.config.shipped_files import shipped_folder
from rig.config.wiring import TorqueDrive
from sim_plant.emulators.device_objects import ObjectEntry
from sim_plant.emulators.torque_drive import AnalogInput, Scaling, TorqueDriveParams

AMC_EDS, RATED_EDS, ACTUATOR_EDS = (
    shipped_folder() / "devices" / f"{name}.eds"
    for name in ("amc_torque_drive", "cia402_torque_drive", "nanotec_actuator")
)


def drive_parts(
    wiring: TorqueDrive, analog: tuple[AnalogInput, ...], encoder_increments: int
) -> tuple[Path, TorqueDriveParams]:
    """Return device file and parameters of a torque drive with sensors on its inputs."""
    eds, scaling = RATED_EDS, Scaling.RATED
    if wiring.scaling == "amc":
        eds, scaling = AMC_EDS, Scaling.AMC
    return eds, TorqueDriveParams(scaling, analog=analog, encoder_increments=encoder_increments)


def of_its_model(entries: Iterable[ObjectEntry], wiring: TorqueDrive) -> tuple[ObjectEntry, ...]:
    """Return the objects of a drive with the peak current of the rig's model of it."""
    peak = BY_NAME["amc_peak_current"]
    value = wiring.objects.get(peak.name)
    return tuple(
        entry._replace(default=value)
        if value is not None and entry.key == (peak.object, peak.sub)
        else entry
        for entry in entries
    )
