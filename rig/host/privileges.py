"""Checks of the privileges that the host grants the loop."""

from typing import Any

from rig.host.finding import REALTIME, Check, Finding, Host, Verdict

AREA = "privileges"
_PRIVILEGES = {
    "fifo": ("SCHED_FIFO", "the loop runs before every ordinary process"),
    "core": ("a core of its own", "the loop stays on one core"),
    "memory_lock": ("locked memory", "no tick waits for a page from the disk"),
    "latency": (
        "/dev/cpu_dma_latency",
        "the processor does not fall into deep sleep between ticks",
    ),
}
_ADVICE = {
    "fifo": "as root put `@rig - rtprio 90` into /etc/security/limits.d/rig.conf, put yourself in "
    "the group rig and log in again (a service: LimitRTPRIO=90; a container: --cap-add SYS_NICE)",
    "core": "this process may not use the core: see `taskset -p $$` and the cpuset of the "
    "container or service",
    "memory_lock": "as root put `@rig - memlock unlimited` into /etc/security/limits.d/rig.conf "
    "and log in again (a service: LimitMEMLOCK=infinity; a container: --ulimit memlock=-1)",
    "latency": 'as root put KERNEL=="cpu_dma_latency", GROUP="rig", MODE="0660" into '
    "/etc/udev/rules.d/60-rig.rules and reboot (a container: --device /dev/cpu_dma_latency)",
}
_RT_RUNTIME = "/proc/sys/kernel/sched_rt_runtime_us"
_RT_PERIOD = "/proc/sys/kernel/sched_rt_period_us"
_MIN_RT_SHARE = 0.5  # of a core, guaranteed to the loop; it needs a fifth


def findings(host: Host, wakeups: dict[str, Any] | None) -> list[Finding]:
    """Return the privileges granted to the measuring process, and the kernel's limits."""
    return [*_granted(wakeups), _throttling(host)]


def _granted(wakeups: dict[str, Any] | None) -> list[Finding]:
    granted = (wakeups or {}).get("granted") or {}
    core = (wakeups or {}).get("core")
    found = []
    for name, (label, reason) in _PRIVILEGES.items():
        limit = f"granted: {reason}; a rig file with `realtime: required` refuses to arm without it"
        check = Check(AREA, label, limit, REALTIME)
        refusal = granted.get(name)
        if refusal is None:
            found.append(check.unknown("not requested"))
        elif refusal:
            found.append(check.finding(f"refused ({refusal})", Verdict.BAD, _ADVICE[name]))
        else:
            found.append(check.finding(f"granted: core {core}" if name == "core" else "granted"))
    return found


def _throttling(host: Host) -> Finding:
    limit = (
        f"at least {100 * _MIN_RT_SHARE:.0f} % of a core for real-time processes, but less than "
        "100 %: the throttle stops a runaway loop"
    )
    check = Check(AREA, "real-time throttling", limit, REALTIME)
    runtime, period = host.read_int(_RT_RUNTIME), host.read_int(_RT_PERIOD) or 1_000_000
    if runtime is None:
        return check.unknown(f"{_RT_RUNTIME} cannot be read")
    share = runtime / period
    verdict = Verdict.GOOD if share >= _MIN_RT_SHARE else Verdict.BAD
    value = f"{100 * share:.0f} % of each {period / 1e6:g} s"
    if runtime < 0:
        verdict, value = Verdict.WARNING, "off: a runaway loop keeps its core forever"
    advice = f"`echo 950000 > {_RT_RUNTIME}` as root"
    return check.finding(value, verdict, advice, runtime_us=runtime, period_us=period)
