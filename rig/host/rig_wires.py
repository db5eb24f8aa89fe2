"""Checks of one rig's wires on this host."""

from collections.abc import Callable
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

from drivers.canopen.bus_settings import BusSettings
from rig.config.rig_file import BaseRigFile
from rig.config.wiring import RtuLine, TcpLine, Wiring
from rig.host.finding import REALTIME, Finding, Host, Verdict, forbidden_uses
from rig.host.wires import DIALOUT, backend_trouble
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.wiring import BenchWiring
from rig.kinds.oswec_bench.hardware.job import build_bench_job
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.hardware.job import WiringError, build_job
from rig.recording.runs.create import BusyError
from rig.wires import wire_check
from rig.wires.locks import Wire, acquire, can_wire, network_wire

_EMULATED = "if you will start `rig sim` or a run with --sim: nothing; else switch the device on"


class _WireCheck(NamedTuple):
    """State of a wire of the rig."""

    check: str
    value: str  # address
    trouble: str
    limit: str
    advice: str
    emulated: bool  # its address is on this host's loopback, or no device file


def area(rig: BaseRigFile) -> str:
    """Return the heading of a rig's findings."""
    return f"wires of {rig.name}"


def findings(host: Host, rig: BaseRigFile) -> list[Finding]:
    """Return the findings on the wiring, then on every wire: hardware, and an answering device."""
    area_name = area(rig)
    if rig.wiring is None:
        value = "none: the rig can only be rehearsed"
        return [Finding(area_name, "wiring", value, "", Verdict.NOTE)]
    try:
        if isinstance(rig, BenchRigFile):
            return _bench_findings(area_name, host, rig, rig.wiring)
        assert isinstance(rig, RigFile)
        load = build_job(rig).load.total
    except WiringError as error:
        advice = "correct the rig file"
        text = "; ".join(str(error).splitlines())
        return [Finding(area_name, "wiring", text, "", Verdict.BAD, advice, REALTIME)]
    assert isinstance(rig.wiring, Wiring)
    can = rig.wiring.can
    bus = BusSettings(can.interface, can.channel, can.bit_rate, tuple(can.options.items()))
    limit = "at most 80 % in the worst case: the rest is for messages that do not come every tick"
    found = [
        Finding(area_name, "load of the CAN bus", f"{100 * load:.0f} %", limit, Verdict.GOOD),
        _backend(area_name, can.interface),
        _finding(area_name, _can(host, bus)),
    ]
    for name, line in rig.wiring.lines.items():
        found.append(_finding(area_name, _line(host, name, line)))
    return found


def _bench_findings(
    area_name: str, host: Host, rig: BenchRigFile, wiring: BenchWiring
) -> list[Finding]:
    """Return the findings on the bench's serial ports and lines.

    A load cell on UDP shows its presence only by an answer, so the finding only names its address.
    """
    build_bench_job(rig)
    ports = {"encoder bridge": wiring.encoders.port, "servo drive": wiring.servo.port}
    found = [_finding(area_name, _port(check, port)) for check, port in ports.items()]
    found += [_finding(area_name, _line(host, name, line)) for name, line in wiring.lines.items()]
    cell, limit = wiring.load_cell, "use `rig devices` to query it"
    address = f"{cell.host}:{cell.port}"
    return [*found, Finding(area_name, "load cell", address, limit, Verdict.NOTE)]


def _backend(area_name: str, interface: str) -> Finding:
    check, limit = (
        f"python-can on {interface}",
        "can be imported, with the library of the adapter's manufacturer",
    )
    trouble = backend_trouble(interface)
    if not trouble:
        return Finding(area_name, check, "installed", limit, Verdict.GOOD)
    advice = (
        "install the missing part: see the page of this interface in python-can's documentation"
    )
    return Finding(area_name, check, trouble, limit, Verdict.BAD, advice, REALTIME)


def _can(host: Host, bus: BusSettings) -> _WireCheck:
    value = f"{bus.interface} {bus.channel}"
    if bus.interface == "socketcan":
        trouble = wire_check.network_problem(bus.channel, host.root)
        advice = (
            f"as root `ip link set {bus.channel} up type can bitrate {bus.bit_rate}`; if there is "
            "no such interface, plug in the adapter and load its driver"
        )
        return _WireCheck(
            "CAN bus", value, trouble, "the interface exists and is up", advice, False
        )
    if bus.interface == "socketcand":
        address = str(dict(bus.options).get("host", "127.0.0.1"))
        wire = can_wire(bus.interface, bus.channel, dict(bus.options))
        trouble, used = _check_unless_in_use(wire, lambda: wire_check.bus_problem(bus))
        limit, advice = "a server listens there", "start socketcand there"
        return _WireCheck("CAN bus", value + used, trouble, limit, advice, _loopback(address))
    limit = "use `rig scan can` to open it"
    return _WireCheck("CAN bus", value, "", limit, "", False)


def _line(host: Host, name: str, line: TcpLine | RtuLine) -> _WireCheck:
    check = f"line {name}"
    if isinstance(line, TcpLine):
        wire = network_wire(check, "tcp", line.host, line.port)
        trouble, used = _check_unless_in_use(
            wire, lambda: wire_check.tcp_problem(line.host, line.port)
        )
        advice = "check its power, its address, and that this host is in its network"
        value, limit = f"{line.host}:{line.port}{used}", "a server listens there"
        return _WireCheck(check, value, trouble, limit, advice, _loopback(line.host))
    return _port(check, line.port)


def _check_unless_in_use(wire: Wire, check: Callable[[], str]) -> tuple[str, str]:
    """Return the trouble of a wire, and a note if another program uses it.

    A wire in use is not tested: some devices accept one connection only, and a second one would
    close that of a run.
    """
    try:
        with acquire((wire,), "rig doctor"):
            return check(), ""
    except BusyError:
        return "", " (in use by another program, so not tested)"


def _port(check: str, port: str) -> _WireCheck:
    trouble = wire_check.port_problem(port)
    advice = DIALOUT if "opened" in trouble else "plug the adapter in; see /dev/serial/by-id"
    emulated = Path("/dev") not in Path(port).parents and not Path(port).exists()
    limit = "exists, and this user may open it"
    return _WireCheck(check, port, trouble, limit, advice, emulated)


def _finding(area_name: str, wire: _WireCheck) -> Finding:
    value = f"{wire.value}: {wire.trouble}" if wire.trouble else wire.value
    if not wire.trouble:
        return Finding(area_name, wire.check, value, wire.limit, Verdict.GOOD)
    if wire.emulated:
        return Finding(area_name, wire.check, value, wire.limit, Verdict.WARNING, _EMULATED)
    verdict = Verdict.BAD
    forbids = forbidden_uses(verdict, *REALTIME)
    return Finding(area_name, wire.check, value, wire.limit, verdict, wire.advice, forbids)


def _loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
