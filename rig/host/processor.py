"""Checks of the loop's processor: its core, other load, virtual machines, and the kernel."""

import os
from typing import NamedTuple

from rig.host.finding import REALTIME, Finding, Host, Verdict, forbidden_uses, grade
from rig.realtime import scheduling

AREA = "processor"
_CPU = "/sys/devices/system/cpu"
_LOAD_GOOD = 0.5  # of the cores
STALLED = 0.5  # of a period: a later wake-up of a virtual machine is a stall by its host


class CpuTime(NamedTuple):
    """Processor time of the whole machine since its boot, in seconds."""

    total: float
    stolen: float  # by other virtual machines of the same host

    @staticmethod
    def read(host: Host) -> "CpuTime | None":
        """Return the current counters; None where they cannot be read."""
        columns = (host.read_text("/proc/stat") or "").split("\n")[0].split()[1:9]
        try:
            ticks = [int(column) / os.sysconf("SC_CLK_TCK") for column in columns]
            return CpuTime(sum(ticks), ticks[7])
        except (ValueError, IndexError):
            return None


def findings(
    host: Host,
    core: int,
    before: CpuTime | None,
    after: CpuTime | None,
    latest: float | None = None,
) -> list[Finding]:
    """Return the findings on the loop's ``core`` and on the whole machine.

    ``before`` and ``after`` enclose the measurement of the loop's wake-ups. ``latest`` is the
    largest lateness of a wake-up, in periods; None if it was not measured.
    """
    return [
        _count(),
        _isolated(host, core),
        _siblings(host, core),
        _governor(host, core),
        _load(host),
        _virtual(host, _stolen_share(before, after), latest),
        _stolen(before, after),
        _kernel(host),
    ]


def _count() -> Finding:
    check, limit = "cores", "2 or more: the loop keeps one, all other processes share the rest"
    count = os.cpu_count() or 1
    verdict = Verdict.GOOD if count > 1 else Verdict.BAD
    advice = "" if count > 1 else "use a machine with more cores"
    return Finding(
        AREA,
        check,
        str(count),
        limit,
        verdict,
        advice,
        forbidden_uses(verdict, *REALTIME),
        {"n": count},
    )


def _isolated(host: Host, core: int) -> Finding:
    check, limit = f"isolation of core {core}", "no ordinary processes on it since the boot"
    text = host.read_text(f"{_CPU}/isolated")
    if text is None:
        return Finding(AREA, check, "the kernel gives no value", limit, Verdict.UNKNOWN)
    try:
        isolated = core in scheduling.parse_core_list(text)
    except ValueError:
        return Finding(AREA, check, f"not understood: {text[:20]}", limit, Verdict.UNKNOWN)
    if isolated:
        return Finding(AREA, check, f"isolated ({text})", limit, Verdict.GOOD)
    advice = (
        f"boot with `isolcpus=domain,managed_irq,{core} nohz_full={core} rcu_nocbs={core}`; "
        "the loop takes an isolated core by itself"
    )
    return Finding(AREA, check, "not isolated", limit, Verdict.WARNING, advice)


def _siblings(host: Host, core: int) -> Finding:
    check = f"hyperthreads of core {core}"
    limit = "one: a second one can halve the speed of the loop's core at any time"
    text = host.read_text(f"{_CPU}/cpu{core}/topology/thread_siblings_list")
    try:
        others = scheduling.parse_core_list(text or "") - {core}
    except ValueError:
        text = None
    if not text:
        return Finding(AREA, check, "the kernel gives no value", limit, Verdict.UNKNOWN)
    if not others:
        return Finding(AREA, check, "one", limit, Verdict.GOOD)
    several = ", ".join(map(str, sorted(others)))
    advice = "; ".join(f"`echo 0 > {_CPU}/cpu{other}/online`" for other in sorted(others))
    return Finding(
        AREA, check, f"shared with {several}", limit, Verdict.WARNING, f"{advice} as root"
    )


def _governor(host: Host, core: int) -> Finding:
    check, limit = "frequency governor", "performance: others are slow to speed up for a short tick"
    path = f"{_CPU}/cpu{core}/cpufreq/scaling_governor"
    governor = host.read_text(path)
    if not governor:
        return Finding(AREA, check, "the kernel shows none", limit, Verdict.UNKNOWN)
    if governor == "performance":
        return Finding(AREA, check, governor, limit, Verdict.GOOD)
    advice = f"`echo performance > {path}` as root, for every core"
    return Finding(AREA, check, governor[:40], limit, Verdict.WARNING, advice)


def _load(host: Host) -> Finding:
    cores = os.cpu_count() or 1
    check, limit = "load", f"at most {_LOAD_GOOD * cores:g}: half of the {cores} cores"
    try:
        load = float((host.read_text("/proc/loadavg") or "").split()[0])
    except (ValueError, IndexError):
        return Finding(AREA, check, "cannot be read", limit, Verdict.UNKNOWN)
    verdict = grade(load, _LOAD_GOOD * cores, float("inf"))
    advice = "" if verdict is Verdict.GOOD else "see `top`; stop programs that are not needed"
    value = f"{load:g} over the last minute"
    return Finding(AREA, check, value, limit, verdict, advice, (), {"load": load})


def _virtual(host: Host, stolen: float | None, latest: float | None) -> Finding:
    check, limit = (
        "virtual machine or container",
        "neither: a host can stall its virtual machines at any time",
    )
    cpuinfo = host.read_text("/proc/cpuinfo")
    if cpuinfo is None:
        return Finding(AREA, check, "cannot be read", limit, Verdict.UNKNOWN)
    flags = next((line for line in cpuinfo.splitlines() if line.startswith("flags")), "")
    kinds = []
    if "hypervisor" in flags.split() or host.exists("/sys/hypervisor/type"):
        product = (host.read_text("/sys/class/dmi/id/product_name") or "")[:40]
        kinds.append("a virtual machine" + (f" ({product})" if product else ""))
    if host.exists("/.dockerenv") or host.exists("/run/.containerenv"):
        kinds.append("a container")
    if not kinds:
        return Finding(AREA, check, "neither", limit, Verdict.GOOD)
    advice = "run a rig from a dedicated machine; shared machines have shown stalls of 30 to 40 ms"
    value = " in ".join(kinds[::-1])
    stalls = [f"{100 * stolen:.2g} % of its time stolen"] if stolen else []
    if latest is not None and latest > STALLED:
        stalls.append(f"a wake-up {latest:.2g} periods late")
    verdict = Verdict.BAD if stalls and "machine" in value else Verdict.WARNING
    if verdict is Verdict.BAD:  # a day will show worse stalls than these seconds
        value += f", stalled during the measurement ({' and '.join(stalls)})"
    return Finding(AREA, check, value, limit, verdict, advice, forbidden_uses(verdict, *REALTIME))


def _stolen_share(before: CpuTime | None, after: CpuTime | None) -> float | None:
    if before is None or after is None or after.total <= before.total:
        return None
    return (after.stolen - before.stolen) / (after.total - before.total)


def _stolen(before: CpuTime | None, after: CpuTime | None) -> Finding:
    check, limit = "time stolen by other virtual machines", "none during the measurement"
    share = _stolen_share(before, after)
    if share is None:
        return Finding(AREA, check, "cannot be read", limit, Verdict.UNKNOWN)
    verdict = Verdict.GOOD if share == 0.0 else Verdict.WARNING
    advice = "" if share == 0.0 else "the host is shared; ask for a dedicated one"
    return Finding(
        AREA, check, f"{100 * share:.2f} %", limit, verdict, advice, (), {"share": share}
    )


def _kernel(host: Host) -> Finding:
    check, limit = "kernel", "PREEMPT_RT: it bounds the time that the kernel can delay the loop"
    version = host.read_text("/proc/version")
    if version is None:
        return Finding(AREA, check, "cannot be read", limit, Verdict.UNKNOWN)
    release = [*version.split(), "", "", "?"][2]
    if host.read_text("/sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        return Finding(AREA, check, f"{release}, PREEMPT_RT", limit, Verdict.GOOD)
    advice = "install the distribution's real-time kernel (Debian: linux-image-rt-amd64)"
    return Finding(AREA, check, f"{release[:40]}, not real-time", limit, Verdict.WARNING, advice)
