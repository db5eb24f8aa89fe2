"""The drive driver against a drive in another language: npm's `canopen`, over socketcand's text.

Needs node and npm; the package is fetched once into the folder for temporary files and kept there.
"""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from canopen_drives import OWN, axis_settings, foreign_steps, until

from drivers.canopen.bus_cycle import BusCycle
from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.heartbeat import NmtState
from drivers.canopen.link import Link
from drivers.canopen.service import Service
from drivers.canopen.torque_axis import TorqueAxis
from drivers.cia402 import arming

NODE = 5
PACKAGE = "canopen@6.2.1"
TIMEOUT_S = 60.0  # s
SCRIPT = Path(__file__).with_name("foreign_drive.js")


@functools.cache
def modules() -> Path:
    """The folder of the package; skips where it cannot be had."""
    kept = Path(tempfile.gettempdir()) / f"wec-rig-npm-{PACKAGE.replace('@', '-')}-{os.getuid()}"
    if not (shutil.which("node") and shutil.which("npm")):
        pytest.skip("node and npm are not installed: no CANopen node in another language")
    if not kept.exists():
        with tempfile.TemporaryDirectory() as folder:
            demand = ["npm", "install", "--ignore-scripts", "--no-audit", "--no-fund"]
            try:
                done = subprocess.run(
                    [*demand, "--prefix", folder, PACKAGE],
                    capture_output=True, text=True, check=False, timeout=TIMEOUT_S,
                )  # fmt: skip
            except subprocess.TimeoutExpired:
                pytest.skip(f"npm did not give {PACKAGE} in {TIMEOUT_S:g} s")
            if done.returncode:
                pytest.skip(f"npm does not give {PACKAGE}: {done.stderr.strip()[-200:]}")
            shutil.copytree(folder, f"{kept}.part", dirs_exist_ok=True)
            Path(f"{kept}.part").rename(kept)
    return kept / "node_modules"


@pytest.fixture(scope="module")
def bus() -> Iterator[BusSettings]:
    environment = {**os.environ, "NODE_PATH": str(modules())}
    with subprocess.Popen(
        ["node", str(SCRIPT), str(NODE)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment,
    ) as drive:  # fmt: skip
        assert drive.stdout is not None
        assert drive.stdin is not None
        port = int(drive.stdout.readline())
        options = (("host", "127.0.0.1"), ("port", port), ("tcp_tune", True))
        yield BusSettings("socketcand", "can0", 1_000_000, options)
        drive.stdin.close()
        assert drive.wait(5.0) == 0


@pytest.fixture
def service(bus: BusSettings) -> Iterator[Service]:
    one = Service(bus)
    one.watch(NODE)
    until(lambda: one.read(NODE, 0x1000, 0, "u32") is not None, lambda: None)
    yield one
    one.close()


def test_it_is_set_up_over_sdo_and_what_it_refuses_is_named(service: Service) -> None:
    assert service.set_up(NODE, foreign_steps(NODE)) == ()
    mismatches = service.set_up(
        NODE, foreign_steps(NODE, rated_current=20_000, encoder_motor_revolutions=1)
    )
    assert arming.format_mismatches(mismatches) == (
        "0x608f:02 encoder_motor_revolutions: expected 1, no answer\n"
        "0x6075:00 rated_current: expected 20000 (0x4e20), got 10000 (0x2710)"
    )
    assert service.identity(NODE).name == "npm drive"
    assert service.read(NODE, 0x5FFF, 0, "u32") is None


def test_torque_goes_out_and_status_comes_back(bus: BusSettings, service: Service) -> None:
    assert service.set_up(NODE, foreign_steps(NODE)) == ()
    service.start(NODE)
    until(lambda: service.health()[NODE].nmt == NmtState.OPERATIONAL, lambda: None)
    axis = TorqueAxis(axis_settings(NODE))
    link = Link(bus, axis.sync_dividers)
    cycle = BusCycle(link, [axis], OWN, 0.05)
    demand: list[float] = [0.0, 0]

    def tick() -> None:
        cycle.send([axis.command(demand[0], int(demand[1]), cycle.receive())])

    try:
        until(lambda: axis.read(link.now()).age < 0.1, tick)
        demand[:] = [-12.34, 1]
        until(lambda: axis.read(link.now()).acting, tick)
        until(lambda: axis.read(link.now()).current == pytest.approx(-12.34), tick)
        before = axis.read(link.now()).counts
        assert before < 0
        until(lambda: axis.read(link.now()).counts > before, tick)
        demand[:] = [float("nan"), 1]
        until(lambda: axis.read(link.now()).current == 0.0, tick)
        demand[:] = [1.0, 0]
        until(lambda: not axis.read(link.now()).acting, tick)
        assert (axis.refused, link.errors, link.unsent) == (0, 0, 0)
    finally:
        cycle.close()
    service.stop(NODE)
    until(lambda: service.health()[NODE].nmt == NmtState.PRE_OPERATIONAL, lambda: None)
