"""Checks of the network card of an EtherCAT segment, and of the rights to use it.

Interrupt coalescing and offloads of a card hold frames back or join them; the ethtool ioctls of the
kernel (linux/ethtool.h) tell them.
"""

import ctypes
import fcntl
import socket
import struct
from importlib.util import find_spec
from pathlib import Path

from rig.host.finding import REALTIME, Check, Finding, Host, Verdict
from rig.wires.wire_check import network_problem

_SIOCETHTOOL = 0x8946
_GET_COALESCING, _GET_LRO, _GET_GRO, _LRO = 0x0000000E, 0x00000025, 0x0000002B, 1 << 15
_MAX_WAIT_US = 10  # that a card may hold a frame back
_CAPABILITIES = {12: "CAP_NET_ADMIN", 13: "CAP_NET_RAW"}


def findings(place: str, host: Host, interface: str) -> list[Finding]:
    """Return the findings on a segment's interface; ``place``: heading of the rig's wires."""
    return [
        _interface(place, host, interface),
        _driver(place, host, interface),
        _holding_back(place, interface),
        _rights(place, host),
        _pysoem(place),
    ]


def _interface(place: str, host: Host, interface: str) -> Finding:
    check = Check(place, "EtherCAT", "the network interface exists and is up", REALTIME)
    trouble = network_problem(interface, host.root)
    if not trouble:
        speed = host.read_int(f"/sys/class/net/{interface}/speed")
        return check.finding(f"{interface}, {speed} Mbit/s" if speed and speed > 0 else interface)
    if "no interface" in trouble:
        advice = (
            "plug the card in; `ip link` lists all. With --sim, and with `rig sim`, the cable to "
            "emulated slaves is made by itself"
        )
        return check.finding(f"{interface}: {trouble}", Verdict.WARNING, advice)
    advice = f"as root `ip link set {interface} up`"
    return check.finding(f"{interface}: {trouble}", Verdict.BAD, advice)


def _driver(place: str, host: Host, interface: str) -> Finding:
    limit = "a wired card of its own: nothing but frames of the segment"
    check = Check(place, "driver of the card", limit)
    driver = _link_name(host, f"/sys/class/net/{interface}/device/driver")
    if driver:
        return check.finding(driver)
    if host.exists(f"/sys/class/net/{interface}"):
        return check.finding("none: a virtual interface, as for emulated slaves", Verdict.NOTE)
    return check.finding("not known", Verdict.NOTE)


def _holding_back(place: str, interface: str) -> Finding:
    limit = f"frames are not held back (at most {_MAX_WAIT_US} us) and not joined (no GRO, no LRO)"
    check = Check(place, "offload and coalescing", limit, REALTIME)
    wait_us, joins = _coalescing(interface), _joined(interface)
    if wait_us is None and joins is None:
        return check.finding("the driver does not tell", Verdict.NOTE)
    value = [] if wait_us is None else [f"holds frames back for up to {wait_us} us"]
    value += [f"{name} on" for name in joins or ()]
    text = ", ".join(value) or "none"
    commands = []
    if wait_us is not None and wait_us > _MAX_WAIT_US:
        commands.append(f"`ethtool -C {interface} rx-usecs 0 tx-usecs 0`")
    if joins:
        options = " ".join(f"{name.lower()} off" for name in joins)
        commands.append(f"`ethtool -K {interface} {options}`")
    if not commands:
        return check.finding(text)
    return check.finding(text, Verdict.WARNING, f"as root {' and '.join(commands)}")


def _rights(place: str, host: Host) -> Finding:
    limit = "raw frames need CAP_NET_RAW, the set-up by pysoem CAP_NET_ADMIN as well"
    check = Check(place, "rights to use the card", limit, REALTIME)
    lines = (host.read_text("/proc/self/status") or "").splitlines()
    effective = next((line.split()[1] for line in lines if line.startswith("CapEff:")), "0")
    missing = [name for bit, name in _CAPABILITIES.items() if not int(effective, 16) >> bit & 1]
    if not missing:
        return check.finding(" and ".join(sorted(_CAPABILITIES.values())))
    advice = (
        "run as root, or give the interpreter the rights: `setcap cap_net_raw,cap_net_admin+ep "
        "$(readlink -f .venv/bin/python3)`; for emulated slaves `unshare -Urn` does"
    )
    return check.finding(f"missing {' and '.join(missing)}", Verdict.BAD, advice)


def _pysoem(place: str) -> Finding:
    check = Check(place, "pysoem", "sets the segment up", REALTIME)
    if find_spec("pysoem") is not None:
        return check.finding("installed")
    return check.finding("not installed", Verdict.BAD, "pip install 'wec-rig[ethercat]'")


def _link_name(host: Host, path: str) -> str:
    try:
        return Path(host.root / path.lstrip("/")).readlink().name
    except OSError:
        return ""


def _coalescing(interface: str) -> int | None:
    """Return how long (us) a card may hold a received frame back; None if it does not tell."""
    answer = _ethtool(interface, struct.pack("=23I", _GET_COALESCING, *[0] * 22))
    return None if answer is None else int(struct.unpack("=23I", answer)[1])


def _joined(interface: str) -> list[str] | None:
    """Return the offloads that join received frames and are on; None if the card tells none."""
    found: list[str] = []
    answers = 0
    for name, command, mask in (("GRO", _GET_GRO, 0xFFFFFFFF), ("LRO", _GET_LRO, _LRO)):
        answer = _ethtool(interface, struct.pack("=2I", command, 0))
        if answer is not None:
            answers += 1
            if struct.unpack("=2I", answer)[1] & mask:
                found.append(name)
    return found if answers else None


def _ethtool(interface: str, command: bytes) -> bytes | None:
    buffer = ctypes.create_string_buffer(command, len(command))
    request = struct.pack("16sP", interface.encode()[:15], ctypes.addressof(buffer))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        try:
            fcntl.ioctl(own, _SIOCETHTOOL, request)
        except OSError:
            return None
    return buffer.raw
