"""Checks of the loop's processor: its core, other load, virtual machines, and the kernel."""

import os
from typing import NamedTuple

from rig.host.finding import REALTIME, Check, Finding, Host, Verdict, grade
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
    limit = "2 or more: the loop keeps one, all other processes share the rest"
    count = os.cpu_count() or 1
    verdict = Verdict.GOOD if count > 1 else Verdict.BAD
    return Check(AREA, "cores", limit, REALTIME).finding(
        str(count), verdict, "use a machine with more cores", n=count
    )


def _isolated(host: Host, core: int) -> Finding:
    check = Check(AREA, f"isolation of core {core}", "no ordinary processes on it since the boot")
    text = host.read_text(f"{_CPU}/isolated")
    if text is None:
        return check.unknown("the kernel gives no value")
    try:
        isolated = core in scheduling.parse_core_list(text)
    except ValueError:
        return check.unknown(f"not understood: {text[:20]}")
    if isolated:
        return check.finding(f"isolated ({text})")
    advice = (
        f"boot with `isolcpus=domain,managed_irq,{core} nohz_full={core} rcu_nocbs={core}`; "
        "the loop takes an isolated core by itself"
    )
    return check.finding("not isolated", Verdict.WARNING, advice)


def _siblings(host: Host, core: int) -> Finding:
    limit = "one: a second one can halve the speed of the loop's core at any time"
    check = Check(AREA, f"hyperthreads of core {core}", limit)
    text = host.read_text(f"{_CPU}/cpu{core}/topology/thread_siblings_list")
    try:
        others = scheduling.parse_core_list(text or "") - {core}
    except ValueError:
        text = None
    if not text:
        return check.unknown("the kernel gives no value")
    if not others:
        return check.finding("one")
    several = ", ".join(map(str, sorted(others)))
    advice = "; ".join(f"`echo 0 > {_CPU}/cpu{other}/online`" for other in sorted(others))
    return check.finding(f"shared with {several}", Verdict.WARNING, f"{advice} as root")


def _governor(host: Host, core: int) -> Finding:
    limit = "performance: others are slow to speed up for a short tick"
    check = Check(AREA, "frequency governor", limit)
    path = f"{_CPU}/cpu{core}/cpufreq/scaling_governor"
    governor = host.read_text(path)
    if not governor:
        return check.unknown("the kernel shows none")
    if governor == "performance":
        return check.finding(governor)
    advice = f"`echo performance > {path}` as root, for every core"
    return check.finding(governor[:40], Verdict.WARNING, advice)


def _load(host: Host) -> Finding:
    cores = os.cpu_count() or 1
    check = Check(AREA, "load", f"at most {_LOAD_GOOD * cores:g}: half of the {cores} cores")
    try:
        load = float((host.read_text("/proc/loadavg") or "").split()[0])
    except (ValueError, IndexError):
        return check.unknown()
    verdict = grade(load, _LOAD_GOOD * cores, float("inf"))
    value, advice = f"{load:g} over the last minute", "see `top`; stop programs that are not needed"
    return check.finding(value, verdict, advice, load=load)


def _virtual(host: Host, stolen: float | None, latest: float | None) -> Finding:
    limit = "neither: a host can stall its virtual machines at any time"
    check = Check(AREA, "virtual machine or container", limit, REALTIME)
    cpuinfo = host.read_text("/proc/cpuinfo")
    if cpuinfo is None:
        return check.unknown()
    flags = next((line for line in cpuinfo.splitlines() if line.startswith("flags")), "")
    kinds = []
    if "hypervisor" in flags.split() or host.exists("/sys/hypervisor/type"):
        product = (host.read_text("/sys/class/dmi/id/product_name") or "")[:40]
        kinds.append("a virtual machine" + (f" ({product})" if product else ""))
    if host.exists("/.dockerenv") or host.exists("/run/.containerenv"):
        kinds.append("a container")
    if not kinds:
        return check.finding("neither")
    advice = "run a rig from a dedicated machine; shared machines have shown stalls of 30 to 40 ms"
    value = " in ".join(kinds[::-1])
    stalls = [f"{100 * stolen:.2g} % of its time stolen"] if stolen else []
    if latest is not None and latest > STALLED:
        stalls.append(f"a wake-up {latest:.2g} periods late")
    verdict = Verdict.BAD if stalls and "machine" in value else Verdict.WARNING
    if verdict is Verdict.BAD:  # a day will show worse stalls than these seconds
        value += f", stalled during the measurement ({' and '.join(stalls)})"
    return check.finding(value, verdict, advice)


def _stolen_share(before: CpuTime | None, after: CpuTime | None) -> float | None:
    if before is None or after is None or after.total <= before.total:
        return None
    return (after.stolen - before.stolen) / (after.total - before.total)


def _stolen(before: CpuTime | None, after: CpuTime | None) -> Finding:
    check = Check(AREA, "time stolen by other virtual machines", "none during the measurement")
    share = _stolen_share(before, after)
    if share is None:
        return check.unknown()
    verdict = Verdict.GOOD if share == 0.0 else Verdict.WARNING
    advice = "the host is shared; ask for a dedicated one"
    return check.finding(f"{100 * share:.2f} %", verdict, advice, share=share)


def _kernel(host: Host) -> Finding:
    limit = "PREEMPT_RT: it bounds the time that the kernel can delay the loop"
    check = Check(AREA, "kernel", limit)
    version = host.read_text("/proc/version")
    if version is None:
        return check.unknown()
    release = [*version.split(), "", "", "?"][2]
    if host.read_text("/sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        return check.finding(f"{release}, PREEMPT_RT")
    advice = "install the distribution's real-time kernel (Debian: linux-image-rt-amd64)"
    return check.finding(f"{release[:40]}, not real-time", Verdict.WARNING, advice)
