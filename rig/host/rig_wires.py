"""Checks of one rig's wires on this host."""

from collections.abc import Callable
from pathlib import Path

from rig.config.rig_file import BaseRigFile
from rig.config.wiring import CanBus, RtuLine, SerialPort, TcpLine, Wire
from rig.host.finding import REALTIME, Check, Finding, Host, Verdict
from rig.host.wires import DIALOUT, backend_trouble
from rig.kinds import find
from rig.recording.runs.create import BusyError
from rig.wires import wire_check
from rig.wires.job import WiringError
from rig.wires.locks import acquire, lockable

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
        load = find(rig.kind).room("hardware.job").build_job(rig).bus_load
    except WiringError as error:
        text = "; ".join(str(error).splitlines())
        return [wiring_check.finding(text, Verdict.BAD, "correct the rig file")]
    found = []
    if load is not None:
        limit = (
            "at most 80 % in the worst case: the rest is for messages that do not come every tick"
        )
        check = Check(place, "load of the CAN bus", limit)
        found.append(check.finding(f"{100 * load.total:.0f} %"))
    for wire in rig.wiring.wires():
        part = wire.part
        if isinstance(part, CanBus):
            found += [_backend(place, part.interface), _can(place, host, wire, part)]
        elif isinstance(part, TcpLine):
            found.append(_tcp(place, wire, part))
        elif isinstance(part, SerialPort | RtuLine):
            found.append(_port(place, wire.name, part.port))
        else:  # a device on UDP shows its presence only by an answer
            check = Check(place, wire.name, "use `rig devices` to query it")
            found.append(check.finding(wire.address, Verdict.NOTE))
    return found


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


def _can(place: str, host: Host, wire: Wire, can: CanBus) -> Finding:
    bus = can.settings()
    if bus.interface == "socketcan":
        check = Check(place, "CAN bus", "the interface exists and is up", REALTIME)
        advice = (
            f"as root `ip link set {bus.channel} up type can bitrate {bus.bit_rate}`; if there is "
            "no such interface, plug in the adapter and load its driver"
        )
        trouble = wire_check.network_problem(bus.channel, host.root)
        return _wire(check, wire.address, trouble, advice)
    if bus.interface == "socketcand":
        check = Check(place, "CAN bus", "a server listens there", REALTIME)
        trouble, used = _check_unless_in_use(wire, lambda: wire_check.bus_problem(bus))
        emulated = wire_check.is_loopback(bus.endpoint[0])
        return _wire(check, wire.address + used, trouble, "start socketcand there", emulated)
    return Check(place, "CAN bus", "use `rig scan can` to open it").finding(wire.address)


def _tcp(place: str, wire: Wire, line: TcpLine) -> Finding:
    check = Check(place, wire.name, "a server listens there", REALTIME)
    trouble, used = _check_unless_in_use(wire, lambda: wire_check.tcp_problem(line.host, line.port))
    advice = "check its power, its address, and that this host is in its network"
    emulated = wire_check.is_loopback(line.host)
    return _wire(check, f"{wire.address}{used}", trouble, advice, emulated)


def _check_unless_in_use(wire: Wire, check: Callable[[], str]) -> tuple[str, str]:
    """Return the trouble of a wire, and a note if another program uses it.

    A wire in use is not tested: some devices accept one connection only, and a second one would
    close that of a run.
    """
    try:
        with acquire((lockable(wire),), "rig doctor"):
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
