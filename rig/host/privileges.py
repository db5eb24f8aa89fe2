"""What the host grants the loop."""

from typing import Any

from rig.host.finding import REALTIME, Finding, Host, Verdict, forbidding

AREA = "privileges"
_WHAT = {
    "fifo": ("SCHED_FIFO", "ahead of every ordinary process"),
    "core": ("a core of its own", "the loop does not wander from core to core"),
    "memory_lock": ("locked memory", "no tick waits for a page from the disk"),
    "latency": (
        "/dev/cpu_dma_latency",
        "the processor does not fall into deep sleep between ticks",
    ),
}
_ADVICE = {
    "fifo": "as root put `@rig - rtprio 90` into /etc/security/limits.d/rig.conf, put yourself in "
    "the group rig and log in anew (a service: LimitRTPRIO=90; a container: --cap-add SYS_NICE)",
    "core": "the core is outside what this process may use: see `taskset -p $$` and the cpuset of "
    "the container or service",
    "memory_lock": "as root put `@rig - memlock unlimited` into /etc/security/limits.d/rig.conf "
    "and log in anew (a service: LimitMEMLOCK=infinity; a container: --ulimit memlock=-1)",
    "latency": 'as root put KERNEL=="cpu_dma_latency", GROUP="rig", MODE="0660" into '
    "/etc/udev/rules.d/60-rig.rules and reboot (a container: --device /dev/cpu_dma_latency)",
}
_RUNTIME = "/proc/sys/kernel/sched_rt_runtime_us"
_PERIOD = "/proc/sys/kernel/sched_rt_period_us"
_SHARE = 0.5  # of a core that the loop must be sure of; it needs a fifth


def findings(host: Host, woken: dict[str, Any] | None) -> list[Finding]:
    """What the measuring process was granted, and what the kernel allows such processes."""
    return [*_granted(woken), _throttling(host)]


def _granted(woken: dict[str, Any] | None) -> list[Finding]:
    granted = (woken or {}).get("granted") or {}
    core = (woken or {}).get("core")
    found = []
    for name, (what, why) in _WHAT.items():
        limit = f"granted: {why}; a rig that says `realtime: required` refuses to arm without"
        refusal = granted.get(name)
        if refusal is None:
            verdict, value, advice = Verdict.UNKNOWN, "not asked for", ""
        elif refusal:
            verdict, value, advice = Verdict.BAD, f"refused ({refusal})", _ADVICE[name]
        else:
            verdict, value, advice = Verdict.GOOD, "granted", ""
            if name == "core":
                value = f"granted: core {core}"
        spoils = forbidding(verdict, *REALTIME)
        found.append(Finding(AREA, what, value, limit, verdict, advice, spoils))
    return found


def _throttling(host: Host) -> Finding:
    what, limit = (
        "real-time throttling",
        f"at least {100 * _SHARE:.0f} % of a core for real-time processes, and not without end: "
        "it is what stops a loop that runs away",
    )
    runtime, period = host.number(_RUNTIME), host.number(_PERIOD) or 1_000_000
    if runtime is None:
        return Finding(AREA, what, f"{_RUNTIME} cannot be read", limit, Verdict.UNKNOWN)
    numbers = {"runtime_us": runtime, "period_us": period}
    if runtime < 0:
        advice = f"`echo 950000 > {_RUNTIME}` as root"
        value = "off: a loop that runs away keeps its core for good"
        return Finding(AREA, what, value, limit, Verdict.WARNING, advice, (), numbers)
    share = runtime / period
    verdict = Verdict.GOOD if share >= _SHARE else Verdict.BAD
    return Finding(
        AREA,
        what,
        f"{100 * share:.0f} % of each {period / 1e6:g} s",
        limit,
        verdict,
        "" if verdict is Verdict.GOOD else f"`echo 950000 > {_RUNTIME}` as root",
        forbidding(verdict, *REALTIME),
        numbers,
    )
