"""The processor the loop would run on, the kernel over it, and who else is there."""

import os
from typing import NamedTuple

from rig.host.finding import REALTIME, Finding, Host, Verdict, forbidding, graded
from rig.realtime import scheduling

AREA = "processor"
_CPU = "/sys/devices/system/cpu"
_LOAD_GOOD = 0.5  # of the cores
STALLED = 0.5  # of a period: a virtual machine's wake-up later than that is its host's doing


class Busy(NamedTuple):
    """Processor time of the whole machine since it was started, in seconds."""

    all: float
    stolen: float  # by other guests of the same host

    @staticmethod
    def of(host: Host) -> "Busy | None":
        """The counters as they stand; None where they cannot be read."""
        words = (host.text("/proc/stat") or "").split("\n")[0].split()[1:9]
        try:
            ticks = [int(word) / os.sysconf("SC_CLK_TCK") for word in words]
            return Busy(sum(ticks), ticks[7])
        except (ValueError, IndexError):
            return None


def findings(
    host: Host, core: int, before: Busy | None, after: Busy | None, latest: float | None = None
) -> list[Finding]:
    """``core``: the loop's; ``before`` and ``after`` enclose the measurement of its wake-ups.

    ``latest``: how late the latest of them was, of a period; None if it was not measured.
    """
    return [
        _count(),
        _isolated(host, core),
        _siblings(host, core),
        _governor(host, core),
        _load(host),
        _virtual(host, _share_stolen(before, after), latest),
        _stolen(before, after),
        _kernel(host),
    ]


def _count() -> Finding:
    what, limit = "cores", "2 or more: the loop keeps one, all else shares the others"
    count = os.cpu_count() or 1
    verdict = Verdict.GOOD if count > 1 else Verdict.BAD
    advice = "" if count > 1 else "use a machine with more cores"
    return Finding(
        AREA, what, str(count), limit, verdict, advice, forbidding(verdict, *REALTIME), {"n": count}
    )


def _isolated(host: Host, core: int) -> Finding:
    what, limit = f"isolation of core {core}", "kept free of ordinary processes from the boot on"
    text = host.text(f"{_CPU}/isolated")
    if text is None:
        return Finding(AREA, what, "the kernel does not say", limit, Verdict.UNKNOWN)
    try:
        alone = core in scheduling.cores(text)
    except ValueError:
        return Finding(AREA, what, f"not understood: {text[:20]}", limit, Verdict.UNKNOWN)
    if alone:
        return Finding(AREA, what, f"isolated ({text})", limit, Verdict.GOOD)
    advice = (
        f"boot with `isolcpus=domain,managed_irq,{core} nohz_full={core} rcu_nocbs={core}`; "
        "the loop takes an isolated core by itself"
    )
    return Finding(AREA, what, "not isolated", limit, Verdict.WARNING, advice)


def _siblings(host: Host, core: int) -> Finding:
    what, limit = f"hyperthreads of core {core}", "one: a second one halves the loop's core at will"
    text = host.text(f"{_CPU}/cpu{core}/topology/thread_siblings_list")
    try:
        others = scheduling.cores(text or "") - {core}
    except ValueError:
        text = None
    if not text:
        return Finding(AREA, what, "the kernel does not say", limit, Verdict.UNKNOWN)
    if not others:
        return Finding(AREA, what, "one", limit, Verdict.GOOD)
    several = ", ".join(map(str, sorted(others)))
    advice = "; ".join(f"`echo 0 > {_CPU}/cpu{other}/online`" for other in sorted(others))
    return Finding(
        AREA, what, f"shared with {several}", limit, Verdict.WARNING, f"{advice} as root"
    )


def _governor(host: Host, core: int) -> Finding:
    what, limit = "frequency governor", "performance: others are slow to speed up for a short tick"
    path = f"{_CPU}/cpu{core}/cpufreq/scaling_governor"
    governor = host.text(path)
    if not governor:
        return Finding(AREA, what, "none to be seen", limit, Verdict.UNKNOWN)
    if governor == "performance":
        return Finding(AREA, what, governor, limit, Verdict.GOOD)
    advice = f"`echo performance > {path}` as root, for every core"
    return Finding(AREA, what, governor[:40], limit, Verdict.WARNING, advice)


def _load(host: Host) -> Finding:
    cores = os.cpu_count() or 1
    what, limit = "load", f"at most {_LOAD_GOOD * cores:g}: half of the {cores} cores"
    try:
        load = float((host.text("/proc/loadavg") or "").split()[0])
    except (ValueError, IndexError):
        return Finding(AREA, what, "cannot be read", limit, Verdict.UNKNOWN)
    verdict = graded(load, _LOAD_GOOD * cores, float("inf"))
    advice = "" if verdict is Verdict.GOOD else "see `top`; stop what is not needed"
    value = f"{load:g} over the last minute"
    return Finding(AREA, what, value, limit, verdict, advice, (), {"load": load})


def _virtual(host: Host, stolen: float | None, latest: float | None) -> Finding:
    what, limit = "virtual machine or container", "neither: a host stalls its guests at will"
    cpuinfo = host.text("/proc/cpuinfo")
    if cpuinfo is None:
        return Finding(AREA, what, "cannot be read", limit, Verdict.UNKNOWN)
    flags = next((line for line in cpuinfo.splitlines() if line.startswith("flags")), "")
    kinds = []
    if "hypervisor" in flags.split() or host.there("/sys/hypervisor/type"):
        product = (host.text("/sys/class/dmi/id/product_name") or "")[:40]
        kinds.append("a virtual machine" + (f" ({product})" if product else ""))
    if host.there("/.dockerenv") or host.there("/run/.containerenv"):
        kinds.append("a container")
    if not kinds:
        return Finding(AREA, what, "neither", limit, Verdict.GOOD)
    advice = (
        "run a rig from a machine of its own; stalls of 30 to 40 ms have been seen on shared ones"
    )
    value = " in ".join(kinds[::-1])
    stalls = [f"{100 * stolen:.2g} % of its time stolen"] if stolen else []
    if latest is not None and latest > STALLED:
        stalls.append(f"a wake-up {latest:.2g} periods late")
    verdict = Verdict.BAD if stalls and "machine" in value else Verdict.WARNING
    if verdict is Verdict.BAD:  # what was seen in seconds will be worse in a day
        value += f", stalled while it was measured ({' and '.join(stalls)})"
    return Finding(AREA, what, value, limit, verdict, advice, forbidding(verdict, *REALTIME))


def _share_stolen(before: Busy | None, after: Busy | None) -> float | None:
    if before is None or after is None or after.all <= before.all:
        return None
    return (after.stolen - before.stolen) / (after.all - before.all)


def _stolen(before: Busy | None, after: Busy | None) -> Finding:
    what, limit = "time stolen by other guests", "none while it was measured"
    share = _share_stolen(before, after)
    if share is None:
        return Finding(AREA, what, "cannot be read", limit, Verdict.UNKNOWN)
    verdict = Verdict.GOOD if share == 0.0 else Verdict.WARNING
    advice = "" if share == 0.0 else "the host is shared; ask for a dedicated one"
    return Finding(AREA, what, f"{100 * share:.2f} %", limit, verdict, advice, (), {"share": share})


def _kernel(host: Host) -> Finding:
    what, limit = "kernel", "PREEMPT_RT: bounds how long the kernel itself holds the loop up"
    version = host.text("/proc/version")
    if version is None:
        return Finding(AREA, what, "cannot be read", limit, Verdict.UNKNOWN)
    release = [*version.split(), "", "", "?"][2]
    if host.text("/sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        return Finding(AREA, what, f"{release}, PREEMPT_RT", limit, Verdict.GOOD)
    advice = "install the distribution's real-time kernel (Debian: linux-image-rt-amd64)"
    return Finding(AREA, what, f"{release[:40]}, not real-time", limit, Verdict.WARNING, advice)
