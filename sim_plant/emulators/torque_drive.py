"""The emulated drive of heave or surge: cyclic synchronous torque on the world's motor.

Two scalings of current: the maker's own (AMC: 6071 in DC2, 6077 in DC1, Kp in 20D8:0C) and per
mille of rated torque (CiA 402: 6071, 6077 over 6076; rated torque goes with rated current 6075).
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from sim_plant.emulators import node_errors
from sim_plant.emulators.can_hub import CanHub
from sim_plant.emulators.canopen_node import NodeParams
from sim_plant.emulators.cia402 import Action
from sim_plant.emulators.cia402_node import (
    CYCLIC_TORQUE,
    LIMITED,
    MODE_12,
    Cia402Node,
    DriveParams,
)
from sim_plant.emulators.node_faults import Fault
from sim_plant.emulators.node_objects import rounded
from sim_plant.emulators.schedule import Schedule
from sim_plant.emulators.shared_world import SharedWorld
from sim_plant.units import Ampere, Second, Volt

PER_VOLT = 819.2  # raw per volt of an analog input
FULL_SCALE = 8191  # raw: 10 V
PLANT_FAULTS = {
    1: node_errors.VENDOR,
    2: node_errors.DC_LINK_UNDER_VOLTAGE,
    3: node_errors.DC_LINK_OVER_VOLTAGE,
}
ALL_WELL = (0, 0, 0, 0, 0, 0, 0)


class Axis(Enum):
    """Which motor of the world it drives; the value begins the names of its words."""

    HEAVE = "heave"
    SURGE = "surge"


class Scaling(Enum):
    """What the raw numbers of current mean."""

    AMC = "DC1 and DC2 of Kp"
    RATED = "per mille of rated torque"


class AnalogInput(NamedTuple):
    """What hangs on one analog input."""

    reading: str  # field of the world's Readings
    per_volt: float  # of its unit


LOAD_CELLS = (AnalogInput("force_lcb", 1000.0), AnalogInput("force_trs", 1000.0))


class TorqueDriveParams(NamedTuple):
    """What a torque drive is told beside its object dictionary."""

    axis: Axis
    scaling: Scaling
    drive: DriveParams = DriveParams()
    analog: tuple[AnalogInput, ...] = LOAD_CELLS  # in the order of 201A:01, :02
    bus_voltage: Volt = 150.0  # of a drive whose bus the world does not tell (surge)


TORQUE_FAULTS = (
    Fault("wrong_kp", "20D8:0C and all its scaling are another drive's", "factor on Kp", 0.5),
    Fault("no_torque", "enabled, but no current flows"),
    Fault("inverted_motor", "two of its phases are swapped: current and force have the other sign"),
    Fault("encoder_reversed", "6064 counts the other way from where it is"),
    Fault("encoder_step", "6064 is shifted at once", "counts", 4000.0),
    Fault("encoder_creep", "6064 drifts away", "counts/s", 400.0),
    Fault("load_cell_saturated", "analog input 1 stands at its positive end"),
    Fault("load_cell_dead", "both analog inputs read 0 V"),
    Fault("load_cell_inverted", "analog input 1 has the other sign"),
    Fault("limit_switch", "60FD: a limit switch is closed", "bit: 0 negative, 1 positive", 0.0),
)


class TorqueDrive(Cia402Node):
    """A drive of one motor."""

    def __init__(
        self,
        params: NodeParams,
        torque: TorqueDriveParams,
        hub: CanHub,
        schedule: Schedule,
        world: SharedWorld,
    ) -> None:
        self.torque = torque
        name = torque.axis.value
        self._command, self._enable = f"{name}_current", f"{name}_enable"
        self._heave = torque.axis is Axis.HEAVE
        self.current: Ampere = 0.0  # commanded to the world
        self._written: tuple[Ampere, int] = (0.0, 0)
        self._limited = False
        self._counts: int | None = None
        self._turned_at = 0  # counts where the encoder was reversed
        self._creeps_since: Second = 0.0
        super().__init__(params, torque.drive, hub, schedule, world)
        self.fault_list.add(*TORQUE_FAULTS)

    # ---- scaling --------------------------------------------------------------------------------

    @property
    def kp(self) -> Ampere:
        """Peak current of the drive (AMC: 20D8:0C in 0.1 A)."""
        return 0.1 * self.objects.get(0x20D8, 0xC)

    def raw_target(self, current: Ampere) -> int:
        """Give 6071 of a current."""
        if self.torque.scaling is Scaling.AMC:
            return rounded(current * 32768.0 / self.kp)
        return self.raw_current(current)

    def asked(self) -> Ampere:
        """Give the current that 6071 (and 60B2) ask for, within the drive's own limits."""
        get = self.objects.get
        if self.torque.scaling is Scaling.AMC:
            return get(0x6071) * self.kp / 32768.0
        most = min(get(0x6072), get(0x6073))
        wanted = get(0x6071) + get(0x60B2)
        permille = max(-most, min(most, wanted))
        self._limited = permille != wanted
        return permille * get(0x6075) * 1.0e-6

    def raw_current(self, current: Ampere) -> int:
        """Give 6077 of a current."""
        if self.torque.scaling is Scaling.AMC:
            return rounded(current * 8192.0 / self.kp)
        return rounded(current * 1.0e6 / max(1, self.objects.get(0x6075)))

    # ---- a drive's part -------------------------------------------------------------------------

    def measure(self, elapsed: Second) -> None:
        """Put encoder, current, voltage, temperature and analog inputs."""
        read, put, active = self.world.readings(), self.objects.put, self.active
        heave = self._heave
        counts = self._counted(read.heave_counts if heave else read.surge_counts)
        current = read.heave_current if heave else read.surge_current
        self.put_position(counts)
        if elapsed > 0.0:
            if self._counts is not None:
                self._put_velocity((counts - self._counts) / elapsed)
            self._counts = counts
        put(0x6077, self.raw_current(current))
        for sub, (reading, per_volt) in enumerate(self.torque.analog, start=1):
            put(0x201A, analog(getattr(read, reading), per_volt), sub)
        if "load_cell_saturated" in active:
            put(0x201A, FULL_SCALE, 1)
        elif "load_cell_dead" in active:
            put(0x201A, 0, 1)
            put(0x201A, 0, 2)
        elif "load_cell_inverted" in active:
            reading, per_volt = self.torque.analog[0]
            put(0x201A, analog(-getattr(read, reading), per_volt), 1)
        put(0x6078, self.objects.values[0x6077, 0])
        put(0x60FD, 1 << int(active["limit_switch"]) if "limit_switch" in active else 0)

    def look_round(self) -> None:
        """Put voltage, temperature and the maker's status words."""
        super().look_round()
        self.objects.put(0x2021, round(self.seen_temperature() * 65536.0), 1)
        volts = self.seen_voltage()
        if self.torque.scaling is Scaling.AMC:
            self._put_own(volts)
        else:
            self.objects.put(0x6079, rounded(1000.0 * volts))

    def act(self, elapsed: Second) -> None:
        """Command the world's motor: 0 A and off unless a mode and the machine say otherwise."""
        action = self.machine.action
        if action is Action.FOLLOW and self.mode == CYCLIC_TORQUE:
            self.current = self.asked()
        elif action is Action.SLOW_DOWN:
            self.current = towards_zero(self.current, elapsed * self._slope())
        else:  # a quick stop takes the torque away at once [NC]
            self.current = 0.0
        flowing = 0.0 if "no_torque" in self.active else self.current
        if "inverted_motor" in self.active:
            flowing = -flowing
        written = (flowing, 1 if action is not Action.OFF else 0)
        if written != self._written:
            self._written = written
            self.world.actuate(**{self._command: flowing, self._enable: written[1]})

    def at_rest(self) -> bool:
        """No current is asked for any more."""
        return self.current == 0.0

    def voltage(self) -> Volt:
        """Heave has the world's bus, surge a stiff one."""
        if self._heave:
            return self.world.readings().bus_voltage
        return self.torque.bus_voltage

    def mode_bits(self) -> int:
        """Give bit 11, current limited, and bit 12, the drive follows its set-point."""
        read = self.world.readings()
        enabled = read.heave_enabled if self._heave else read.surge_enabled
        follows = self.machine.action is Action.FOLLOW and self.mode == CYCLIC_TORQUE
        limited = self._limited or (self._heave and read.drive_saturated)
        return (MODE_12 if enabled and follows else 0) | (LIMITED if limited and follows else 0)

    def cause(self) -> int:
        """Give the fault of the world's own drive, if any."""
        read = self.world.readings()
        code = read.heave_fault if self._heave else read.surge_fault
        return PLANT_FAULTS[code] if code else 0

    def fault_began(self, fault: Fault) -> None:
        """Remember where and when the encoder began to go wrong."""
        super().fault_began(fault)
        read = self.world.readings()
        if fault.name == "encoder_reversed":
            self._turned_at = read.heave_counts if self._heave else read.surge_counts
        elif fault.name == "encoder_creep":
            self._creeps_since = self.world.time

    def restarted(self) -> None:
        """Power-on: no current."""
        self._counts = None
        self._limited = False
        super().restarted()

    def _apply_faults(self) -> None:
        super()._apply_faults()
        nominal = self.storage.defaults.get((0x20D8, 0xC), 0)
        self.objects.put(0x20D8, round(nominal * self.active.get("wrong_kp", 1.0)), 0xC)

    def _counted(self, counts: int) -> int:
        """Give the encoder's counts as its faults have them."""
        active = self.active
        if "encoder_reversed" in active:
            counts = 2 * self._turned_at - counts
        counts += int(active.get("encoder_step", 0.0))
        rate = active.get("encoder_creep", 0.0)
        return counts + int(rate * (self.world.time - self._creeps_since))

    def _slope(self) -> float:
        """Give the torque slope 6087 (per mille of rated, or of peak, per second) in A/s."""
        amc = self.torque.scaling is Scaling.AMC
        rated = self.kp if amc else 1.0e-3 * self.objects.get(0x6075)
        return 1.0e-3 * rated * self.objects.get(0x6087)

    def _put_velocity(self, speed: float) -> None:
        """Put 606C in counts/s, or in DS1: raw = counts/s 2^17 / (Ki Ks)."""
        if self.torque.scaling is Scaling.AMC:
            scale = self.objects.get(0x2032, 8) * self.objects.get(0x20D8, 0x24)
            speed *= 131072.0 / max(1, scale)
        self.objects.put(0x606C, rounded(speed))

    def _put_own(self, volts: Volt) -> None:
        """Put the maker's objects: bus voltage DV1 = V 2^14 / (1.05 Kov), currents, status."""
        put = self.objects.put
        kov = 0.1 * self.objects.get(0x20D8, 9)
        put(0x200F, rounded(min(65535.0, max(0.0, volts) * 16384.0 / (1.05 * kov))), 1)
        put(0x2010, self.objects.get(0x6077), 1)
        put(0x2010, self.raw_current(self.current), 2)
        words = self._status_words() if self.errors.active else ALL_WELL
        for sub, word in enumerate(words, start=1):
            put(0x2002, word, sub)
            put(0x2003, self.objects.get(0x2003, sub) | word, sub)

    def _status_words(self) -> tuple[int, ...]:
        """Give 2002:01..07. Which word tells what is the maker's, the bits here are not [NC]."""
        found = self.errors.active
        protection = (
            (node_errors.OVER_CURRENT in found)
            | (node_errors.DC_LINK_UNDER_VOLTAGE in found) << 1
            | (node_errors.DC_LINK_OVER_VOLTAGE in found) << 2
            | (node_errors.OVER_TEMPERATURE in found) << 3
        )
        silent = {node_errors.HEARTBEAT_LOST, node_errors.RPDO_TIMEOUT} & found
        return (0, protection, int(node_errors.SENSOR in found), int(bool(silent)), 0, 0, 0)


def analog(value: float, per_volt: float) -> int:
    """Give the raw value of an amplified sensor, held within +-10 V."""
    return max(-FULL_SCALE - 1, min(FULL_SCALE, rounded(value * PER_VOLT / per_volt)))


def towards_zero(value: float, reach: float) -> float:
    """Give a value brought nearer to 0 by `reach`, exactly 0 at the end."""
    if abs(value) <= reach:
        return 0.0
    return value - reach if value > 0.0 else value + reach
