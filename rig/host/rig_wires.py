"""Checks of one rig's wires on this host."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from rig.config.rig_file import BaseRigFile
from rig.config.wiring import CanBus, RtuLine, SerialPort, TcpLine, Wire
from rig.host.finding import REALTIME, Finding, Host, Verdict, forbidden_uses
from rig.host.wires import DIALOUT, backend_trouble
from rig.kinds import find
from rig.recording.runs.create import BusyError
from rig.wires import wire_check
from rig.wires.job import WiringError
from rig.wires.locks import acquire, lockable

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
        load = find(rig.kind).room("hardware.job").build_job(rig).bus_load
    except WiringError as error:
        advice = "correct the rig file"
        text = "; ".join(str(error).splitlines())
        return [Finding(area_name, "wiring", text, "", Verdict.BAD, advice, REALTIME)]
    found = []
    if load is not None:
        check, value = "load of the CAN bus", f"{100 * load.total:.0f} %"
        limit = (
            "at most 80 % in the worst case: the rest is for messages that do not come every tick"
        )
        found.append(Finding(area_name, check, value, limit, Verdict.GOOD))
    for wire in rig.wiring.wires():
        part = wire.part
        if isinstance(part, CanBus):
            found.append(_backend(area_name, part.interface))
            found.append(_finding(area_name, _can(host, wire, part)))
        elif isinstance(part, TcpLine):
            found.append(_finding(area_name, _tcp(wire, part)))
        elif isinstance(part, SerialPort | RtuLine):
            found.append(_finding(area_name, _port(wire.name, part.port)))
        else:  # a device on UDP shows its presence only by an answer
            limit = "use `rig devices` to query it"
            found.append(Finding(area_name, wire.name, wire.address, limit, Verdict.NOTE))
    return found


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


def _can(host: Host, wire: Wire, can: CanBus) -> _WireCheck:
    bus, value = can.settings(), wire.address
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
        trouble, used = _check_unless_in_use(wire, lambda: wire_check.bus_problem(bus))
        limit, advice = "a server listens there", "start socketcand there"
        emulated = wire_check.is_loopback(bus.endpoint[0])
        return _WireCheck("CAN bus", value + used, trouble, limit, advice, emulated)
    limit = "use `rig scan can` to open it"
    return _WireCheck("CAN bus", value, "", limit, "", False)


def _tcp(wire: Wire, line: TcpLine) -> _WireCheck:
    trouble, used = _check_unless_in_use(wire, lambda: wire_check.tcp_problem(line.host, line.port))
    advice = "check its power, its address, and that this host is in its network"
    value, limit = f"{wire.address}{used}", "a server listens there"
    emulated = wire_check.is_loopback(line.host)
    return _WireCheck(wire.name, value, trouble, limit, advice, emulated)


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
