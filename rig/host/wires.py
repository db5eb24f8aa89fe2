"""Checks of the means to reach devices (CAN, serial ports, loopback TCP), and of a rig's wires."""

import importlib
import logging
import platform
import socket
import time
from collections.abc import Callable
from ctypes.util import find_library
from pathlib import Path

from rig.config.rig_file import BaseRigFile
from rig.config.segment import Segment
from rig.config.wiring import CanBus, RtuLine, SerialPort, TcpLine, Wire, WiringError
from rig.host import network_card
from rig.host.finding import REALTIME, Check, Finding, Host, Verdict, grade
from rig.host.software import REINSTALL
from rig.kinds.registry import find
from rig.processes.wire_locks import acquire, lockable
from rig.recording.runs.create import BusyError
from rig.wires import wire_check

AREA = "wires"
_CAN_DEVICE = 280  # ARPHRD_CAN, in /sys/class/net/*/type
_ROUND_TRIPS = 200
_ROUND_TRIP_GOOD, _ROUND_TRIP_BAD = 0.5e-3, 5e-3  # s, of the 99th percentile
_MAX_LATENCY_MS = 1  # of a USB serial adapter
_SOCKETCAN_LIMIT = (
    "only rigs on `socketcan` need it; socketcand, slcan and manufacturers' libraries do without"
)
_BACKENDS = (
    "socketcan", "socketcand", "slcan", "gs_usb", "pcan", "kvaser", "ixxat", "vector", "virtual",
)  # fmt: skip
_LIBRARIES = {"pcan": "pcanbasic", "kvaser": "canlib", "vector": "vxlapi64"}  # of the manufacturers
_PORTS = ("ttyUSB", "ttyACM", "ttyS", "ttyAMA", "ttyXR", "ttyO")
DIALOUT = "as root `usermod -aG dialout USER` (the group that owns them), then log in again"


def findings(host: Host) -> list[Finding]:
    """Return the findings for any rig; a finding is bad only if it prevents every rig."""
    return [
        _kernel_can(host),
        _interfaces(host),
        _vcan(host),
        _backends(),
        _serial(host),
        _latency(host),
        _loopback(),
    ]


def _module(host: Host, name: str) -> str:
    """Return 'loaded', 'available', or empty if the kernel has no such module."""
    if host.exists(f"/sys/module/{name}"):
        return "loaded"
    folder = f"/lib/modules/{platform.release()}"
    known = (host.read_text(f"{folder}/modules.builtin") or "") + (
        host.read_text(f"{folder}/modules.dep") or ""
    )
    return "available" if f"/{name}.ko" in known else ""


def _kernel_can(host: Host) -> Finding:
    check = Check(AREA, "CAN in the kernel", _SOCKETCAN_LIMIT)
    state = "loaded" if host.exists("/proc/net/can") else _module(host, "can_raw")
    if state == "loaded":
        return check.finding("SocketCAN")
    if state:
        return check.finding("SocketCAN, not loaded yet")
    return check.finding("none in this kernel", Verdict.NOTE)


def _interfaces(host: Host) -> Finding:
    check = Check(AREA, "CAN interfaces", "up, with the bit rate of the bus")
    found = [
        name
        for name in host.list_names("/sys/class/net")
        if host.read_int(f"/sys/class/net/{name}/type") == _CAN_DEVICE
    ]
    if not found:
        return check.finding("none", Verdict.NOTE)
    down = [name for name in found if not _up(host, name)]
    off = [name for name in found if name not in down and _off_the_bus(host, name)]
    states = dict.fromkeys(found, "up") | dict.fromkeys(down, "down")
    states |= dict.fromkeys(off, "off the bus (bus-off)")
    value = ", ".join(f"{name} {state}" for name, state in states.items())
    if not down and not off:
        return check.finding(value)
    advice = f"as root `ip link set {down[0]} up type can bitrate 1000000`" if down else ""
    if off:
        advice = f"check the wire; then as root `ip link set {off[0]} type can restart`"
    return check.finding(value, Verdict.WARNING, advice)


def _up(host: Host, name: str) -> bool:
    try:
        return bool(int(host.read_text(f"/sys/class/net/{name}/flags") or "0", 16) & 1)
    except ValueError:
        return False


def _off_the_bus(host: Host, name: str) -> bool:
    """Return whether an interface has no carrier: on an interface that is up this is bus-off."""
    return (host.read_text(f"/sys/class/net/{name}/carrier") or "").strip() == "0"


def _vcan(host: Host) -> Finding:
    check = Check(AREA, "vcan", "a CAN bus without hardware, for tests on `socketcan`")
    state = _module(host, "vcan")
    if not state:
        return check.finding("none in this kernel", Verdict.NOTE)
    return check.finding(state if state == "loaded" else "available: `modprobe vcan`")


def _backends() -> Finding:
    limit = "the rig's adapter needs its own; `rig scan can` shows whether it is plugged in"
    bad = [name for name in _BACKENDS if backend_trouble(name)]
    good = [name for name in _BACKENDS if name not in bad]
    value = ", ".join(good) + (f"; not {', '.join(bad)}" if bad else "")
    verdict = Verdict.GOOD if good else Verdict.WARNING
    return Check(AREA, "python-can backends", limit).finding(
        value, verdict, REINSTALL, good=good, bad=bad
    )


def backend_trouble(name: str) -> str:
    """Return why a backend of python-can cannot work here; empty if no reason is known."""
    from can.interfaces import BACKENDS  # noqa: PLC0415

    if name not in BACKENDS:
        return f"python-can knows no interface {name!r}"
    logging.getLogger("can").setLevel(logging.ERROR)  # backends log their own messages
    try:
        importlib.import_module(BACKENDS[name][0])
    except Exception as error:  # noqa: BLE001  (each manufacturer's binding raises its own errors)
        return str(error) or type(error).__name__
    library = _LIBRARIES.get(name)
    if library is not None and find_library(library) is None:
        return f"the manufacturer's library ({library}) is not installed"
    return ""


def _serial(host: Host) -> Finding:
    check = Check(AREA, "serial ports", "this user can open every port that has a device")
    found = serial_ports(host)
    if not found:
        return check.finding("none", Verdict.NOTE)
    closed = [name for name in found if not host.is_accessible(f"/dev/{name}")]
    value = ", ".join(
        [name for name in found if name not in closed]
        + [f"not {name} ({host.owner(f'/dev/{name}')})" for name in closed]
    )
    if not closed:
        return check.finding(value)
    return check.finding(value, Verdict.WARNING, DIALOUT)


def serial_ports(host: Host) -> list[str]:
    """Return the names in /dev of serial ports that have a device."""
    found = []
    for name in host.list_names("/sys/class/tty"):
        if name.startswith(_PORTS) and host.exists(f"/sys/class/tty/{name}/device"):
            kind = host.read_int(f"/sys/class/tty/{name}/type")
            if kind != 0:  # 0: a configured UART without hardware
                found.append(name)
    return found


def _latency(host: Host) -> Finding:
    limit = f"{_MAX_LATENCY_MS} ms: FTDI adapters hold bytes back for 16 ms by default"
    check = Check(AREA, "latency of USB serial", limit)
    timers = {
        name: number
        for name in host.list_names("/sys/bus/usb-serial/devices")
        if (number := host.read_int(f"/sys/bus/usb-serial/devices/{name}/latency_timer"))
        is not None
    }
    if not timers:
        return check.finding("no adapter with such a timer", Verdict.NOTE)
    value = ", ".join(f"{name} {number} ms" for name, number in timers.items())
    slow = [name for name, number in timers.items() if number > _MAX_LATENCY_MS]
    if not slow:
        return check.finding(value, **timers)
    advice = (
        f"as root `echo {_MAX_LATENCY_MS} > /sys/bus/usb-serial/devices/{slow[0]}/latency_timer`; "
        'to keep it, put ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", '
        f'ATTR{{latency_timer}}="{_MAX_LATENCY_MS}" into /etc/udev/rules.d/61-rig-serial.rules'
    )
    return check.finding(value, Verdict.WARNING, advice, **timers)


def _loopback() -> Finding:
    limit = (
        f"a round trip in {1e3 * _ROUND_TRIP_GOOD:g} ms at p99, bad above "
        f"{1e3 * _ROUND_TRIP_BAD:g} ms: emulated devices answer over it"
    )
    check = Check(AREA, "TCP on loopback", limit)
    try:
        trips = sorted(round_trips(_ROUND_TRIPS))
    except OSError as error:
        advice = "start loopback: `ip link set lo up`; check the firewall for 127.0.0.1"
        return check.finding(error.strerror or str(error), Verdict.BAD, advice)
    middle, p99 = trips[len(trips) // 2], trips[99 * len(trips) // 100]
    verdict = grade(p99, _ROUND_TRIP_GOOD, _ROUND_TRIP_BAD)
    if verdict is Verdict.BAD:
        verdict = Verdict.WARNING  # it delays emulated devices, no rig
    value = f"p50 {1e6 * middle:.0f}, p99 {1e6 * p99:.0f} us"
    return check.finding(value, verdict, "close other programs", p50_s=middle, p99_s=p99)


def round_trips(count: int) -> list[float]:
    """Return the times (s) of ``count`` one-byte round trips between two sockets of this host."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(2.0)
        client = socket.create_connection(server.getsockname(), 2.0)
        with client:
            server_end, _ = server.accept()
            with server_end:
                server_end.settimeout(2.0)
                for end in (client, server_end):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                times = []
                for _ in range(count):
                    began = time.perf_counter()
                    client.sendall(b"?")
                    server_end.sendall(server_end.recv(1))
                    client.recv(1)
                    times.append(time.perf_counter() - began)
    return times


_EMULATED = "if you will start `rig sim` or a run with --sim: nothing; else switch the device on"


def rig_area(rig: BaseRigFile) -> str:
    """Return the heading of a rig's findings."""
    return f"wires of {rig.name}"


def rig_findings(host: Host, rig: BaseRigFile) -> list[Finding]:
    """Return the findings on the wiring, then on every wire: hardware, and an answering device."""
    place = rig_area(rig)
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
        elif isinstance(part, Segment):
            found += network_card.findings(place, host, part.interface)
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
