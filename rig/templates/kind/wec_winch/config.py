"""The models of the files: rig, limits and plant."""

from typing import Literal

from pydantic import Field
from rig.config.model import FileModel, WholeNumber
from rig.config.rig_file import BaseRigFile, Rate, StopTiming
from rig.config.wiring import CanBus, TorqueDrive, Wiring


class Stop(StopTiming):
    damping_n_s_per_m: float = Field(gt=0, le=1e5)


class WinchWiring(Wiring):
    can: CanBus
    motor: TorqueDrive


class RigFile(BaseRigFile):
    """A rig of kind `winch`."""

    kind: Literal["winch"]
    rate_hz: Rate
    newtons_per_ampere: float = Field(gt=0, le=1e4)
    metres_per_count: float = Field(gt=0, le=1e-3)
    stiffness_n_per_m: float = Field(gt=0, le=1e6)
    damping_n_s_per_m: float = Field(gt=0, le=1e6)
    stop: Stop
    wiring: WinchWiring | None = None


class LimitsFile(FileModel):
    """Limits of the rig."""

    position_stop_m: float = Field(gt=0, le=2)
    slack_stop_m: float = Field(gt=0, le=2)
    velocity_stop_m_per_s: float = Field(gt=0, le=10)
    current_peak_a: float = Field(gt=0, le=100)
    lost_ticks_stop: WholeNumber = Field(ge=1, le=1000)


class PlantFile(FileModel):
    """The float: a mass in water with a restoring stiffness and damping."""

    mass_kg: float = Field(gt=0, le=1e5)
    stiffness_n_per_m: float = Field(gt=0, le=1e6)
    damping_n_s_per_m: float = Field(gt=0, le=1e5)
