"""What this host has to reach devices with: CAN, serial ports, loopback TCP."""

import importlib
import logging
import platform
import socket
import time
from ctypes.util import find_library

from rig.host.finding import Finding, Host, Verdict, graded

AREA = "wires"
_CAN_DEVICE = 280  # ARPHRD_CAN, in /sys/class/net/*/type
_ROUNDS = 200
_TRIP_GOOD, _TRIP_BAD = 0.5e-3, 5e-3  # s, of the 99th percentile
_LATENCY = 1  # ms, of a USB serial adapter
_OFF = "needed by a rig on `socketcan` only; socketcand, slcan and makers' libraries go without"
_BACKENDS = (
    "socketcan", "socketcand", "slcan", "gs_usb", "pcan", "kvaser", "ixxat", "vector", "virtual",
)  # fmt: skip
_LIBRARIES = {"pcan": "pcanbasic", "kvaser": "canlib", "vector": "vxlapi64"}  # of their makers
_PORTS = ("ttyUSB", "ttyACM", "ttyS", "ttyAMA", "ttyXR", "ttyO")
DIALOUT = "as root `usermod -aG dialout USER` (the group that owns them), then log in anew"


def findings(host: Host) -> list[Finding]:
    """What there is, whatever rig it is for; only what hinders every rig is bad."""
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
    """`loaded`, `there` to be loaded, or empty if the kernel has no such module."""
    if host.there(f"/sys/module/{name}"):
        return "loaded"
    folder = f"/lib/modules/{platform.release()}"
    known = (host.text(f"{folder}/modules.builtin") or "") + (
        host.text(f"{folder}/modules.dep") or ""
    )
    return "there" if f"/{name}.ko" in known else ""


def _kernel_can(host: Host) -> Finding:
    what = "CAN in the kernel"
    state = "loaded" if host.there("/proc/net/can") else _module(host, "can_raw")
    if state == "loaded":
        return Finding(AREA, what, "SocketCAN", _OFF, Verdict.GOOD)
    if state:
        return Finding(AREA, what, "SocketCAN, not loaded yet", _OFF, Verdict.GOOD)
    return Finding(AREA, what, "none in this kernel", _OFF, Verdict.NOTE)


def _interfaces(host: Host) -> Finding:
    what, limit = "CAN interfaces", "up, with the bit rate of the bus"
    found = [
        name
        for name in host.names("/sys/class/net")
        if host.number(f"/sys/class/net/{name}/type") == _CAN_DEVICE
    ]
    if not found:
        return Finding(AREA, what, "none", limit, Verdict.NOTE)
    down = [name for name in found if not _up(host, name)]
    off = [name for name in found if name not in down and _off_the_bus(host, name)]
    states = dict.fromkeys(found, "up") | dict.fromkeys(down, "down")
    states |= dict.fromkeys(off, "off the bus (bus-off)")
    words = ", ".join(f"{name} {state}" for name, state in states.items())
    if not down and not off:
        return Finding(AREA, what, words, limit, Verdict.GOOD)
    advice = f"as root `ip link set {down[0]} up type can bitrate 1000000`" if down else ""
    if off:
        advice = f"look at the wire; then as root `ip link set {off[0]} type can restart`"
    return Finding(AREA, what, words, limit, Verdict.WARNING, advice)


def _up(host: Host, name: str) -> bool:
    try:
        return bool(int(host.text(f"/sys/class/net/{name}/flags") or "0", 16) & 1)
    except ValueError:
        return False


def _off_the_bus(host: Host, name: str) -> bool:
    """Whether an interface that is up has no carrier: so a kernel shows bus-off."""
    return (host.text(f"/sys/class/net/{name}/carrier") or "").strip() == "0"


def _vcan(host: Host) -> Finding:
    what, limit = "vcan", "a CAN bus without hardware, for trying things out on `socketcan`"
    state = _module(host, "vcan")
    verdict = Verdict.GOOD if state else Verdict.NOTE
    value = {"loaded": "loaded", "there": "to be had: `modprobe vcan`"}.get(state, "none here")
    return Finding(AREA, what, value, limit, verdict)


def _backends() -> Finding:
    what = "python-can backends"
    limit = "that of the rig's adapter imports; whether one is plugged in, `rig scan can` shows"
    lacking = {name for name in _BACKENDS if backend_trouble(name)}
    good = [name for name in _BACKENDS if name not in lacking]
    bad = [name for name in _BACKENDS if name in lacking]
    value = ", ".join(good) + (f"; not {', '.join(bad)}" if bad else "")
    verdict = Verdict.GOOD if good else Verdict.WARNING
    advice = "" if good else "`make clean setup`"
    return Finding(AREA, what, value, limit, verdict, advice, (), {"good": good, "bad": bad})


def backend_trouble(name: str) -> str:
    """Why a backend of python-can cannot be used here; empty if nothing is known against it."""
    from can.interfaces import BACKENDS  # noqa: PLC0415

    if name not in BACKENDS:
        return f"python-can knows no interface {name!r}"
    logging.getLogger("can").setLevel(logging.ERROR)  # each says what it lacks, in its own way
    try:
        importlib.import_module(BACKENDS[name][0])
    except Exception as error:  # noqa: BLE001  (and each maker's binding fails in a way of its own)
        return str(error) or type(error).__name__
    library = _LIBRARIES.get(name)
    if library is not None and find_library(library) is None:
        return f"the maker's library ({library}) is not installed"
    return ""


def _serial(host: Host) -> Finding:
    what, limit = "serial ports", "those with a device behind them can be opened by this user"
    found = serial_ports(host)
    if not found:
        return Finding(AREA, what, "none", limit, Verdict.NOTE)
    closed = [name for name in found if not host.usable(f"/dev/{name}")]
    told = [f"{name} ({host.owner(f'/dev/{name}')})" for name in closed]
    told = [name for name in found if name not in closed] + [f"not {one}" for one in told]
    if not closed:
        return Finding(AREA, what, ", ".join(told), limit, Verdict.GOOD)
    return Finding(AREA, what, ", ".join(told), limit, Verdict.WARNING, DIALOUT)


def serial_ports(host: Host) -> list[str]:
    """Names in /dev of serial ports that have a device behind them."""
    found = []
    for name in host.names("/sys/class/tty"):
        if name.startswith(_PORTS) and host.there(f"/sys/class/tty/{name}/device"):
            kind = host.number(f"/sys/class/tty/{name}/type")
            if kind != 0:  # 0: a UART that is configured, but not there
                found.append(name)
    return found


def _latency(host: Host) -> Finding:
    what = "latency of USB serial"
    limit = f"{_LATENCY} ms: FTDI adapters hold bytes back for 16 ms by themselves"
    timers = {
        name: number
        for name in host.names("/sys/bus/usb-serial/devices")
        if (number := host.number(f"/sys/bus/usb-serial/devices/{name}/latency_timer")) is not None
    }
    if not timers:
        return Finding(AREA, what, "no adapter with such a timer", limit, Verdict.NOTE)
    value = ", ".join(f"{name} {number} ms" for name, number in timers.items())
    slow = [name for name, number in timers.items() if number > _LATENCY]
    if not slow:
        return Finding(AREA, what, value, limit, Verdict.GOOD, "", (), dict(timers))
    advice = (
        f"as root `echo {_LATENCY} > /sys/bus/usb-serial/devices/{slow[0]}/latency_timer`; for "
        'good, ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", '
        f'ATTR{{latency_timer}}="{_LATENCY}" in /etc/udev/rules.d/61-rig-serial.rules'
    )
    return Finding(AREA, what, value, limit, Verdict.WARNING, advice, (), dict(timers))


def _loopback() -> Finding:
    what = "TCP on loopback"
    limit = (
        f"a round trip in {1e3 * _TRIP_GOOD:g} ms at p99, bad above {1e3 * _TRIP_BAD:g} ms: "
        "emulated devices answer over it"
    )
    try:
        trips = sorted(round_trips(_ROUNDS))
    except OSError as error:
        advice = "bring loopback up: `ip link set lo up`; see the firewall for 127.0.0.1"
        return Finding(AREA, what, error.strerror or str(error), limit, Verdict.BAD, advice)
    middle, p99 = trips[len(trips) // 2], trips[99 * len(trips) // 100]
    verdict = graded(p99, _TRIP_GOOD, _TRIP_BAD)
    if verdict is Verdict.BAD:
        verdict = Verdict.WARNING  # it hinders emulated devices, no rig
    return Finding(
        AREA,
        what,
        f"p50 {1e6 * middle:.0f}, p99 {1e6 * p99:.0f} us",
        limit,
        verdict,
        "" if verdict is Verdict.GOOD else "close what else runs",
        (),
        {"p50_s": middle, "p99_s": p99},
    )


def round_trips(count: int) -> list[float]:
    """Times (s) of so many one-byte questions and answers between two ends on this host."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(2.0)
        asking = socket.create_connection(server.getsockname(), 2.0)
        with asking:
            answering, _ = server.accept()
            with answering:
                answering.settimeout(2.0)
                for end in (asking, answering):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                taken = []
                for _ in range(count):
                    began = time.perf_counter()
                    asking.sendall(b"?")
                    answering.sendall(answering.recv(1))
                    asking.recv(1)
                    taken.append(time.perf_counter() - began)
    return taken
