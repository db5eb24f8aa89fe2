"""The device files of emulated drives, and how a drive of a rig file is emulated."""

from pathlib import Path

from rig.config.shipped_files import shipped_folder
from rig.config.wiring import TorqueDrive
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
