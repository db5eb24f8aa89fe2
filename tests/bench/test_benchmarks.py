"""Every measurement runs in a very short form and gives figures that can be figures."""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from benchmarks import __main__ as runner
from benchmarks import crash, cycle, lateness, reading, rehearsal, ring, start
from benchmarks.support import host, kills, report
from benchmarks.support.kills import Fate, Kill
from benchmarks.support.live import Peek
from benchmarks.support.recorded import Recorded, campaign_file, parts, record
from benchmarks.support.result import Figure, Result, figure, number, quantile, text

HISTOGRAM = """\
# /dev/cpu_dma_latency set to 0us
# Histogram
000003 000010
000004 000085
000090 000004
# Total: 000000099
# Min Latencies: 00003
# Avg Latencies: 00010
# Max Latencies: 12345
# Histogram Overflows: 00001
# Histogram Overflow at cycle number:
# Thread 0: 00042
"""


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bench")


@pytest.fixture(scope="module")
def campaign(scratch: Path) -> Path:
    return campaign_file(scratch, 15.0)


@pytest.fixture(scope="module")
def recorded(campaign: Path) -> Recorded:
    return record(campaign, ticks=600, skip=50)


class Live(NamedTuple):
    """What the measurements give that start whole runs."""

    speed: rehearsal.Speed
    stalled: ring.Stalled
    killed: Fate
    folder: Path  # of the stalled run


@pytest.fixture(scope="module")
def live(scratch: Path, campaign: Path) -> Live:
    """At once what may: most of their time is starting up. The real clock is for one at a time."""
    own = {name: scratch / name for name in ("killed", "stalled")}
    for folder in own.values():
        folder.mkdir()

    with ThreadPoolExecutor() as pool:
        speed = pool.submit(rehearsal.speed, campaign, scratch / "speed", 0.001, None)
        kill = Kill("loop", False, (0.2,))
        stood = ring.stalled_run(own["stalled"], 0.6, 0.2)
        killed = kills.killed(campaign, own["killed"], kill, real_clock=True)
        found = speed.result(), stood, killed
    return Live(*found, next((own["stalled"] / "stalled").glob("*_benchmark")))


def test_the_cycle_repeats_its_rows_and_costs_something(recorded: Recorded) -> None:
    assert cycle.repeats(recorded)
    blocks = cycle.alternate(recorded, 2)
    assert all(len(values) == 2 and min(values) > 0.0 for values in blocks)
    assert all(a <= b <= c for a, b, c in zip(blocks.p50, blocks.p99, blocks.p999, strict=True))


def test_a_put_is_measured_without_losing_a_row(recorded: Recorded) -> None:
    found = ring.cost(recorded, 1)
    assert found.put[0] > 0.0
    assert found.p99[0] > 0.0
    assert len(found.added) == len(found.cycle) == 1


def test_a_tick_is_taken_apart(campaign: Path) -> None:
    found = rehearsal.breakdown(parts(campaign), 0.3)
    assert found.plain > 0.0
    assert len(found.parts) == 4
    assert all(part > 0.0 for part in found.parts)


@pytest.mark.realtime
def test_a_rehearsal_is_timed_from_first_tick_to_last_row(live: Live) -> None:
    assert live.speed.times_real > 1.0
    assert live.speed.loop_us > 1.0
    assert live.speed.logger_us > 0.1


@pytest.mark.realtime
def test_a_stalled_logger_is_counted(live: Live) -> None:
    assert live.stalled.lost == 0
    assert live.stalled.dropped == 0
    assert live.stalled.behind > 50
    assert live.stalled.ticks > 100


@pytest.mark.realtime
def test_every_period_of_a_real_loop_is_accounted_for(live: Live) -> None:
    found = lateness.timing_of(live.folder, 0.4, 0.0)
    late = found.late
    assert found.imbalance == 0
    assert 200 <= late.wakes + found.skipped <= 400  # a gap may reach over the end, of any length
    assert 0.0 <= late.p50 <= late.p99 <= late.worst
    assert 0.0 < found.work[0] <= found.work[1] <= found.work[2]


@pytest.mark.realtime
def test_what_a_killed_loop_leaves_is_counted(live: Live) -> None:
    assert live.killed.wrong == ()
    assert live.killed.put > 0
    assert live.killed.lost == 0
    assert 0.0 <= live.killed.seconds < 1.0
    told = {one.name: one for one in crash.rehearsed_figures(crash.REAL, [live.killed])}
    assert told[f"{crash.REAL}, loop killed: time lost"].held
    assert told[f"{crash.REAL}: claims that failed"].held


def test_a_histogram_gives_percentiles() -> None:
    assert lateness.histogram(HISTOGRAM) == lateness.Block(4.0, 90.0, 12345.0, 100)
    with pytest.raises(ValueError, match="no histogram"):
        lateness.histogram("Unable to change scheduling policy!")


@pytest.mark.skipif(shutil.which("cyclictest") is None, reason=lateness.MISSING)
def test_cyclictest_is_understood() -> None:
    try:
        found = lateness.cyclictest(0.1)
    except RuntimeError as error:
        pytest.skip(str(error))
    assert 95 <= found.wakes <= 100
    assert found.p50 <= found.p99 <= found.worst


def test_drift_is_free_of_looks_that_come_late() -> None:
    even = [Peek(10.0 + 0.01 * i + (0.003 if i % 3 else 0.0), 10 * i) for i in range(40)]
    assert abs(lateness.drift(even)) < 0.01
    runaway = [Peek(peek.at, peek.tick + i // 4) for i, peek in enumerate(even)]
    assert lateness.drift(runaway) > 5.0


def test_reading_counts_rows_and_memory(recorded: Recorded, tmp_path: Path) -> None:
    path = tmp_path / "rows.mcap"
    reading.write_tiled(path, _packed(recorded), 2000)
    found = reading.opened(path, reading.TEN, 2000)
    assert 0.0 < found.call < found.whole
    assert 10.0 < found.peak < 2000.0
    assert reading.stock(path) > 0.0
    assert reading.ours(path) > 0.0


def _packed(recorded: Recorded) -> Any:
    from rig.kinds.wavebot import WaveBotRow
    from rig.recording.row_layout import layout, leaves, packer
    from rig.recording.runs.mcap_file import row_dtype

    pack, size = packer(WaveBotRow), layout(WaveBotRow).size
    data = bytearray(size * len(recorded.rows))
    for i, row in enumerate(recorded.rows):
        pack(data, i * size, row)
    return np.frombuffer(data, row_dtype(leaves(WaveBotRow)))


def test_the_command_line_is_found() -> None:
    assert start.seconds_of([*start.command(), "--help"]) > 0.0


# --- results and the runner


def test_a_figure_is_judged_by_its_median_or_its_worst() -> None:
    assert figure("a", "s", [1.0, 2.0, 9.0], at_most=2.0).held is True
    assert figure("a", "s", [1.0, 2.0, 9.0], at_most=2.0, judge="worst").held is False
    assert figure("a", "x", [30.0, 40.0], at_least=31.0, judge="worst").held is False
    assert figure("a", "%", 95.0, at_least=90.0, at_most=98.0).held is True
    assert figure("a", "%", 99.0, at_least=90.0, at_most=98.0).held is False
    assert figure("a", "%", 89.0, at_least=90.0, at_most=98.0).limit == ">= 90, <= 98"
    assert figure("a", "%", 89.0, at_least=90.0, at_most=98.0).held is False
    assert figure("a", "s", 1.0).held is None
    with pytest.raises(ValueError, match="no figure"):
        figure("a", "s", [float("nan")])


def test_quantiles_are_values_that_were_measured() -> None:
    assert quantile([3, 1, 2], 0.5) == 2.0
    assert quantile(list(range(1, 1001)), 0.999) == 999.0
    assert quantile([5], 0.99) == 5.0


@pytest.mark.parametrize(
    ("value", "words"),
    [(0.0, "0"), (1234.0, "1234"), (1234.56, "1235"), (0.012345, "0.0123"), (12.345, "12.3")],
)
def test_numbers_read_well(value: float, words: str) -> None:
    assert number(value) == words


def _made(short: bool) -> Result:
    figures = (figure("cost", "us", [1.0, 2.5], at_most=1.0), figure("loss", "rows", 0, at_most=0))
    return Result("cycle", f"a thing, short: {short}", "2 blocks", figures, ("by hand",))


@pytest.fixture
def runner_with(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., int]:
    def run(measure: Callable[[bool], Result], *words: str) -> int:
        monkeypatch.setattr(runner, "MEASUREMENTS", {"cycle": measure})
        monkeypatch.setattr(runner, "RESULTS", tmp_path)
        monkeypatch.setattr(sys, "argv", ["benchmarks", *words])
        return runner.main()

    return run


def test_a_result_is_printed_and_kept(
    runner_with: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert runner_with(_made) == 0
    printed = capsys.readouterr().out
    assert "NO" in printed
    assert "not held:\n  cycle: cost, 1.75 us" in printed
    kept = json.loads((tmp_path / "cycle.json").read_text())
    assert [Figure(**one).held for one in kept["figures"]] == [False, True]
    table = (tmp_path / "README.md").read_text()
    assert "| cost | 1.75 | 1 - 2.50 | us | <= 1 | NO |" in table
    assert kept["host"]["kernel"] in table


def test_a_short_run_keeps_nothing(
    runner_with: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert runner_with(_made, "--short", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["short"] is True
    assert told["results"]["cycle"]["what"] == "a thing, short: True"
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_measured_is_said(
    runner_with: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(short: bool) -> Result:
        raise RuntimeError("no such thing here")

    assert runner_with(broken) == 1
    assert "not measured: cycle: RuntimeError: no such thing here" in capsys.readouterr().err


def test_every_measurement_is_known_by_the_name_of_its_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--help"])
    with pytest.raises(SystemExit, match="0"):
        runner.main()
    printed = capsys.readouterr().out
    for name, measure in runner.MEASUREMENTS.items():
        assert measure.__module__ == f"benchmarks.{name}"
        assert re.search(rf"^  {name} +\S", printed, re.MULTILINE)


def test_the_host_is_told_without_its_name() -> None:
    facts = host.facts()
    assert facts["cores"] >= 1
    assert "name" not in facts
    load = host.others(host.Busy.now(), host.Busy.now())
    assert load["other_work_cores"] >= 0.0


def test_a_table_says_what_was_left_out() -> None:
    assert text(_made(True)).endswith("note: by hand")
    assert report.closing([]) == "every number that was measured is held"
