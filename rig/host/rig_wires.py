"""What one rig's wires need of this host."""

from collections.abc import Callable
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

from drivers.canopen.bus_settings import Bus
from rig.config.any_rig_file import AnyRigFile
from rig.config.bench_rig_file import BenchRigFile
from rig.config.bench_wiring import BenchWiring
from rig.config.wiring import RtuLine, TcpLine, Wiring
from rig.execution.hardware import wire_check
from rig.execution.hardware.bench_job import job_of_bench
from rig.execution.hardware.job import WiringError, job_of
from rig.host.finding import REALTIME, Finding, Host, Verdict, forbidding
from rig.host.wires import DIALOUT, backend_trouble
from rig.processes.wire_locks import Wire, can_wire, hold, network_wire
from rig.recording.runs.create import BusyError

_EMULATED = "nothing, if `rig sim` or a run with --sim is to come; else switch the device on"


class _Wire(NamedTuple):
    """How a wire of the rig was found."""

    what: str
    value: str  # where it leads
    trouble: str
    limit: str
    advice: str
    emulated: bool  # it leads to this host's loopback, or to no device file


def area(rig: AnyRigFile) -> str:
    """The heading of a rig's findings."""
    return f"wires of {rig.name}"


def findings(host: Host, rig: AnyRigFile) -> list[Finding]:
    """The wiring by itself, then every wire: is there what it needs, does somebody answer."""
    where = area(rig)
    if rig.wiring is None:
        value = "none: it can only be rehearsed"
        return [Finding(where, "wiring", value, "", Verdict.NOTE)]
    try:
        if isinstance(rig, BenchRigFile):
            return _of_the_bench(where, host, rig, rig.wiring)
        load = job_of(rig).load.total
    except WiringError as error:
        advice = "mend the rig file"
        text = "; ".join(str(error).splitlines())
        return [Finding(where, "wiring", text, "", Verdict.BAD, advice, REALTIME)]
    assert isinstance(rig.wiring, Wiring)
    can = rig.wiring.can
    bus = Bus(can.interface, can.channel, can.bit_rate, tuple(can.options.items()))
    limit = "at most 80 % in the worst case: the rest is for what is not sent in every tick"
    found = [
        Finding(where, "load of the CAN bus", f"{100 * load:.0f} %", limit, Verdict.GOOD),
        _backend(where, can.interface),
        _judged(where, _can(host, bus)),
    ]
    for name, line in rig.wiring.lines.items():
        found.append(_judged(where, _line(host, name, line)))
    return found


def _of_the_bench(where: str, host: Host, rig: BenchRigFile, wiring: BenchWiring) -> list[Finding]:
    """The bench's serial ports and lines; a load cell on UDP says only itself that it is there."""
    job_of_bench(rig)
    ports = {"encoder bridge": wiring.encoders.port, "servo drive": wiring.servo.port}
    found = [_judged(where, _port(what, port)) for what, port in ports.items()]
    found += [_judged(where, _line(host, name, line)) for name, line in wiring.lines.items()]
    cell, limit = wiring.load_cell, "shown only when it is asked: `rig devices`"
    address = f"{cell.host}:{cell.port}"
    return [*found, Finding(where, "load cell", address, limit, Verdict.NOTE)]


def _backend(where: str, interface: str) -> Finding:
    what, limit = f"python-can on {interface}", "imports, with the library of the adapter's maker"
    trouble = backend_trouble(interface)
    if not trouble:
        return Finding(where, what, "there", limit, Verdict.GOOD)
    advice = "install what is missing: the page of this interface in python-can's documentation"
    return Finding(where, what, trouble, limit, Verdict.BAD, advice, REALTIME)


def _can(host: Host, bus: Bus) -> _Wire:
    value = f"{bus.interface} {bus.channel}"
    if bus.interface == "socketcan":
        trouble = wire_check.network_trouble(bus.channel, host.root)
        advice = (
            f"as root `ip link set {bus.channel} up type can bitrate {bus.bit_rate}`; if there is "
            "no such interface, see that the adapter is plugged in and its driver loaded"
        )
        return _Wire("CAN bus", value, trouble, "the interface is there and up", advice, False)
    if bus.interface == "socketcand":
        at = str(dict(bus.options).get("host", "127.0.0.1"))
        wire = can_wire(bus.interface, bus.channel, dict(bus.options))
        trouble, used = _tried(wire, lambda: wire_check.bus_trouble(bus))
        limit, advice = "somebody listens there", "start socketcand there"
        return _Wire("CAN bus", value + used, trouble, limit, advice, _loopback(at))
    limit = "shown only when it is opened: `rig scan can`"
    return _Wire("CAN bus", value, "", limit, "", False)


def _line(host: Host, name: str, line: TcpLine | RtuLine) -> _Wire:
    what = f"line {name}"
    if isinstance(line, TcpLine):
        wire = network_wire(what, "tcp", line.host, line.port)
        trouble, used = _tried(wire, lambda: wire_check.tcp_trouble(line.host, line.port))
        advice = "is it switched on, is its address right, is this host in its network?"
        value, limit = f"{line.host}:{line.port}{used}", "somebody listens there"
        return _Wire(what, value, trouble, limit, advice, _loopback(line.host))
    return _port(what, line.port)


def _tried(wire: Wire, look: Callable[[], str]) -> tuple[str, str]:
    """What stands against a wire, and a note if it is in use: then it is left alone.

    Some devices have room for one connection: a second one would take a run's away.
    """
    try:
        with hold((wire,), "rig doctor"):
            return look(), ""
    except BusyError:
        return "", " (in use by another program, so not tried)"


def _port(what: str, port: str) -> _Wire:
    trouble = wire_check.port_trouble(port)
    advice = DIALOUT if "opened" in trouble else "plug the adapter in; see /dev/serial/by-id"
    emulated = Path("/dev") not in Path(port).parents and not Path(port).exists()
    return _Wire(what, port, trouble, "there, and this user may open it", advice, emulated)


def _judged(where: str, wire: _Wire) -> Finding:
    value = f"{wire.value}: {wire.trouble}" if wire.trouble else wire.value
    if not wire.trouble:
        return Finding(where, wire.what, value, wire.limit, Verdict.GOOD)
    if wire.emulated:
        return Finding(where, wire.what, value, wire.limit, Verdict.WARNING, _EMULATED)
    verdict = Verdict.BAD
    spoils = forbidding(verdict, *REALTIME)
    return Finding(where, wire.what, value, wire.limit, verdict, wire.advice, spoils)


def _loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
