"""The couplings of bench and flap give the bits of their devices.

Compiled ones are compared in `test_coupled_ticks`.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from golden_bench import GOLDEN

from rig.kinds.oswec_bench.rehearsal import bench_coupling, flap_coupling
from rig.kinds.oswec_bench.rehearsal.devices import build_bench, build_flap, connect
from rig.kinds.oswec_bench.rehearsal.job import plant_settings
from rig.kinds.oswec_bench.sessions.assemble import bench_params
from rig.kinds.oswec_bench.sessions.files import open_session
from rig.kinds.oswec_bench.sessions.plan import plan_session
from rig.kinds.oswec_bench.tick.cycle import KIND
from rig.realtime import cycle
from rig.realtime.requests import NO_REQUEST
from rig.realtime.safety import STOP_0

DT = 0.001
NO_TIMING = cycle.Timing(0.0, 0.0, 0)
GOLDEN_SESSIONS = ("bench_velocity", "bench_torque", "bench_brake")
SECOND_ROWS = {  # of the flap's golden sessions
    "bench_decay": "{release_deg: -6, period_s: 2}",
    "bench_flap": "{wave_amplitude_m: 0.03, period_s: 1.25, pto_damping_n_m_s_per_rad: 35}",
}


def session_of(name: str, folder: Path) -> Any:
    """Return a golden session; one of the flap with a second row, in other waves or released."""
    path = GOLDEN / f"{name}.yaml"
    if name in SECOND_ROWS:
        text = path.read_text().replace("rig: ", f"rig: {GOLDEN}/")
        path = folder / path.name
        path.write_text(text.replace("tare:", f"  - {SECOND_ROWS[name]}\ntare:"))
    return open_session(path)


def couple(settings: dict[str, Any]) -> tuple[ModuleType, Any, Any]:
    """Return the coupling's module with plant and device of a session."""
    interpreted = settings | {"compiled": False}
    if "flap" in settings["plant"]:
        return flap_coupling, *flap_coupling.couple(*build_flap(interpreted, DT))
    return bench_coupling, *bench_coupling.couple(build_bench(interpreted, DT))


@pytest.mark.sampled
@pytest.mark.parametrize("name", [*GOLDEN_SESSIONS, *SECOND_ROWS])
def test_a_session_on_the_coupling_has_the_bits_of_the_devices(name: str, tmp_path: Path) -> None:
    """The loop runs on the devices; the coupling gets its commands and gives the same readings."""
    session = session_of(name, tmp_path)
    plan, settings = plan_session(session), plant_settings(session)
    params, loop_step = bench_params(session, plan), cycle.make(KIND)
    devices = connect(settings | {"compiled": False}, DT)
    module, plant, device = couple(settings)
    state, tick, seas, angles = cycle.start(KIND, params, 0), 0, set(), set()
    while state.safety.mode != STOP_0:
        if tick > 0:
            device = module.advance_plant(plant, device, tick, DT)
        read = devices.read(tick * DT)
        # by repr: equal to the last bit, types too
        assert repr(bench_coupling.sense(device.in_transit[0], plant.age)) == repr(read), tick
        assert repr(device.state) == repr(devices._world._stepper.state), tick  # type: ignore[attr-defined]
        state, command, _ = loop_step(params, state, read, NO_REQUEST, tick, NO_TIMING, 1, DT)
        devices.write(command)
        device, interrupted = module.actuate(plant, device, command, DT)
        assert not interrupted
        seas.add(command.sea)
        angles.add(command.clamp if command.locked == 1 else 0.0)
        tick += 1
    assert tick > 3000
    assert (len(seas), len(angles)) == {"bench_decay": (1, 3), "bench_flap": (3, 1)}.get(
        name, (1, 1)
    )
    on = command._replace(enable=1)  # the last command: then the drive's watchdog stops it
    devices.write(on)
    device, _ = module.actuate(plant, device, on, DT)
    faults = set()
    for _ in range(400):
        device = module.advance_plant(plant, device, tick, DT)
        read = devices.read(tick * DT)
        assert repr(bench_coupling.sense(device.in_transit[0], plant.age)) == repr(read), tick
        faults.add(read.servo.fault)
        tick += 1
    assert faults == {0, 1}
