"""Checks of one rig's wires on this host."""

from collections.abc import Callable
from ipaddress import ip_address
from pathlib import Path

from drivers.canopen.bus_settings import BusSettings
from rig.config.rig_file import BaseRigFile
from rig.config.wiring import RtuLine, TcpLine, Wiring
from rig.host.finding import REALTIME, Check, Finding, Host, Verdict
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


def area(rig: BaseRigFile) -> str:
    """Return the heading of a rig's findings."""
    return f"wires of {rig.name}"


def findings(host: Host, rig: BaseRigFile) -> list[Finding]:
    """Return the findings on the wiring, then on every wire: hardware, and an answering device."""
    place = area(rig)
    wiring_check = Check(place, "wiring", "", REALTIME)
    if rig.wiring is None:
        return [wiring_check.finding("none: the rig can only be rehearsed", Verdict.NOTE)]
    try:
        if isinstance(rig, BenchRigFile):
            return _bench_findings(place, rig, rig.wiring)
        assert isinstance(rig, RigFile)
        load = build_job(rig).load.total
    except WiringError as error:
        text = "; ".join(str(error).splitlines())
        return [wiring_check.finding(text, Verdict.BAD, "correct the rig file")]
    assert isinstance(rig.wiring, Wiring)
    can = rig.wiring.can
    bus = BusSettings(can.interface, can.channel, can.bit_rate, tuple(can.options.items()))
    limit = "at most 80 % in the worst case: the rest is for messages that do not come every tick"
    return [
        Check(place, "load of the CAN bus", limit).finding(f"{100 * load:.0f} %"),
        _backend(place, can.interface),
        _can(place, host, bus),
        *(_line(place, name, line) for name, line in rig.wiring.lines.items()),
    ]


def _bench_findings(place: str, rig: BenchRigFile, wiring: BenchWiring) -> list[Finding]:
    """Return the findings on the bench's serial ports and lines.

    A load cell on UDP shows its presence only by an answer, so the finding only names its address.
    """
    build_bench_job(rig)
    cell = Check(place, "load cell", "use `rig devices` to query it")
    return [
        _port(place, "encoder bridge", wiring.encoders.port),
        _port(place, "servo drive", wiring.servo.port),
        *(_line(place, name, line) for name, line in wiring.lines.items()),
        cell.finding(f"{wiring.load_cell.host}:{wiring.load_cell.port}", Verdict.NOTE),
    ]


def _backend(place: str, interface: str) -> Finding:
    limit = "can be imported, with the library of the adapter's manufacturer"
    check = Check(place, f"python-can on {interface}", limit, REALTIME)
    trouble = backend_trouble(interface)
    if not trouble:
        return check.finding("installed")
    advice = (
        "install the missing part: see the page of this interface in python-can's documentation"
    )
    return check.finding(trouble, Verdict.BAD, advice)


def _can(place: str, host: Host, bus: BusSettings) -> Finding:
    value = f"{bus.interface} {bus.channel}"
    if bus.interface == "socketcan":
        check = Check(place, "CAN bus", "the interface exists and is up", REALTIME)
        advice = (
            f"as root `ip link set {bus.channel} up type can bitrate {bus.bit_rate}`; if there is "
            "no such interface, plug in the adapter and load its driver"
        )
        return _wire(check, value, wire_check.network_problem(bus.channel, host.root), advice)
    if bus.interface == "socketcand":
        check = Check(place, "CAN bus", "a server listens there", REALTIME)
        address = str(dict(bus.options).get("host", "127.0.0.1"))
        wire = can_wire(bus.interface, bus.channel, dict(bus.options))
        trouble, used = _check_unless_in_use(wire, lambda: wire_check.bus_problem(bus))
        return _wire(check, value + used, trouble, "start socketcand there", _loopback(address))
    return Check(place, "CAN bus", "use `rig scan can` to open it").finding(value)


def _line(place: str, name: str, line: TcpLine | RtuLine) -> Finding:
    label = f"line {name}"
    if not isinstance(line, TcpLine):
        return _port(place, label, line.port)
    check = Check(place, label, "a server listens there", REALTIME)
    wire = network_wire(label, "tcp", line.host, line.port)
    trouble, used = _check_unless_in_use(wire, lambda: wire_check.tcp_problem(line.host, line.port))
    advice = "check its power, its address, and that this host is in its network"
    return _wire(check, f"{line.host}:{line.port}{used}", trouble, advice, _loopback(line.host))


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


def _port(place: str, label: str, port: str) -> Finding:
    trouble = wire_check.port_problem(port)
    advice = DIALOUT if "opened" in trouble else "plug the adapter in; see /dev/serial/by-id"
    emulated = Path("/dev") not in Path(port).parents and not Path(port).exists()
    check = Check(place, label, "exists, and this user may open it", REALTIME)
    return _wire(check, port, trouble, advice, emulated)


def _wire(check: Check, value: str, trouble: str, advice: str, emulated: bool = False) -> Finding:
    """Return the finding on a wire; ``emulated``: it is on this host, or no device file."""
    if not trouble:
        return check.finding(value)
    value = f"{value}: {trouble}"
    if emulated:
        return check.finding(value, Verdict.WARNING, _EMULATED)
    return check.finding(value, Verdict.BAD, advice)


def _loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
