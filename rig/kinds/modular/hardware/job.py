"""The supervisor's side of a wired modular rig: the settings of its loop and its I/O processes."""

from rig.config.wiring import wiring_of
from rig.kinds.modular.config import RigFile
from rig.wires.job import WiredJob, trigger_divider, wired_job
from rig.wires.messages import WHOLE_NUMBERS


def build_job(rig: RigFile) -> WiredJob:
    """Return the job of a rig file with `wiring`; WiringError lists all reasons against it."""
    wiring = wiring_of(rig)
    sources = wiring.sources()
    given = [(name, each, sources[str(each.source)]) for name, each in rig.sensors.items()]
    devices = {
        "sensors": [
            [name, source.device, source.place, sensor.scale, sensor.offset]
            for name, sensor, source in given
        ],
        "trigger_divider": trigger_divider(rig.rate_hz),
    }
    return wired_job(
        wiring,
        rig.rate_hz,
        devices,
        {name: axis.torque_constant_n_m_per_a for name, axis in rig.axes.items()},
        {name: ("load_cell", cell.model_dump()) for name, cell in wiring.load_cells.items()},
        units={
            str(sensor.source): sensor.unit
            for sensor in rig.sensors.values()
            if (sensor.scale, sensor.offset) == (1.0, 0.0) and sensor.unit not in WHOLE_NUMBERS
        },
    )
