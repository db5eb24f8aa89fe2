"""Every benchmark runs in a very short form and returns valid figures."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from benchmarks import __main__ as runner
from benchmarks import crash, lateness, logging, page_memory, reading, rehearsal, ring, start
from benchmarks.support import host, kills, report
from benchmarks.support.kills import Kill, KillOutcome
from benchmarks.support.live_run import TickObservation
from benchmarks.support.recorded import (
    RecordedTicks,
    record_ticks,
    write_campaign_file,
)
from benchmarks.support.result import Figure, Result, figure, format_number, format_table, quantile
from rig.recording.runs.mcap_file import blocks, scan

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
    return write_campaign_file(scratch, 15.0)


@pytest.fixture(scope="module")
def recorded(campaign: Path) -> RecordedTicks:
    return record_ticks(campaign, ticks=600, skip=50)


class Live(NamedTuple):
    """Results of the benchmarks that start whole runs."""

    speed: rehearsal.RehearsalSpeed
    stalled: ring.StalledRun
    killed: KillOutcome
    folder: Path  # run folder of the stalled run


@pytest.fixture(scope="module")
def live(scratch: Path, campaign: Path) -> Live:
    """Run what can run at once; most of the time is start-up. Only one run has the real clock."""
    folders = {name: scratch / name for name in ("killed", "stalled")}
    for folder in folders.values():
        folder.mkdir()

    with ThreadPoolExecutor() as pool:
        speed = pool.submit(rehearsal.measure_speed, campaign, scratch / "speed", 0.001, None)
        kill = Kill("loop", False, (0.2,))
        stalled = ring.run_with_stalled_logger(folders["stalled"], 0.6, 0.2)
        killed = kills.run_and_kill(campaign, folders["killed"], kill, real_clock=True)
        results = speed.result(), stalled, killed
    return Live(*results, next((folders["stalled"] / "stalled").glob("*_benchmark")))


def test_the_cost_of_a_put_is_measured_without_row_loss(recorded: RecordedTicks) -> None:
    cost = ring.measure_put_cost(recorded, 1)
    assert cost.put[0] > 0.0
    assert cost.p99[0] > 0.0
    assert len(cost.added) == len(cost.cycle) == 1
    assert 0.0 < cost.in_place[0] < cost.put[0]


@pytest.mark.realtime
def test_a_rehearsal_is_timed_from_first_tick_to_last_row(live: Live) -> None:
    assert live.speed.times_real > 1.0
    assert live.speed.loop_us > 1.0
    assert live.speed.logger_us > 0.1


@pytest.mark.realtime
def test_a_stalled_logger_is_counted(live: Live) -> None:
    assert live.stalled.lost == 0
    assert live.stalled.dropped == 0
    assert live.stalled.max_backlog > 50
    assert live.stalled.ticks > 100


@pytest.mark.realtime
def test_every_period_of_a_real_loop_is_accounted_for(live: Live) -> None:
    timing = lateness.loop_timing(live.folder, 0.4, 0.0)
    late = timing.lateness
    assert timing.imbalance == 0
    assert (
        200 <= late.wakes + timing.skipped <= 400
    )  # a gap of any length may extend beyond the end
    assert 0.0 <= late.p50 <= late.p99 <= late.worst
    assert 0.0 < timing.work[0] <= timing.work[1] <= timing.work[2]


@pytest.mark.realtime
def test_the_rows_of_a_killed_loop_are_counted(live: Live) -> None:
    assert live.killed.failures == ()
    assert live.killed.rows_put > 0
    assert live.killed.rows_lost == 0
    assert 0.0 <= live.killed.seconds_lost < 1.0
    figures = {one.name: one for one in crash.rehearsed_figures(crash.REAL, [live.killed])}
    assert figures[f"{crash.REAL}, loop killed: time lost"].target_met
    assert figures[f"{crash.REAL}: claims that failed"].target_met


def test_a_histogram_gives_percentiles() -> None:
    assert lateness.parse_histogram(HISTOGRAM) == lateness.LatenessBlock(4.0, 90.0, 12345.0, 100)
    with pytest.raises(ValueError, match="no histogram"):
        lateness.parse_histogram("Unable to change scheduling policy!")


@pytest.mark.skipif(shutil.which("cyclictest") is None, reason=lateness.NO_CYCLICTEST)
def test_the_output_of_cyclictest_is_parsed() -> None:
    try:
        block = lateness.run_cyclictest(0.1)
    except RuntimeError as error:
        pytest.skip(str(error))
    assert 95 <= block.wakes <= 100
    assert block.p50 <= block.p99 <= block.worst


def test_late_peeks_do_not_count_as_drift() -> None:
    even = [TickObservation(10.0 + 0.01 * i + (0.003 if i % 3 else 0.0), 10 * i) for i in range(40)]
    assert abs(lateness.tick_drift(even)) < 0.01
    runaway = [TickObservation(peek.time, peek.tick + i // 4) for i, peek in enumerate(even)]
    assert lateness.tick_drift(runaway) > 5.0


def test_reading_counts_rows_and_memory(recorded: RecordedTicks, tmp_path: Path) -> None:
    path = tmp_path / "rows.mcap"
    reading.write_tiled(path, _packed(recorded), 2000)
    result = reading.open_in_new_process(path, reading.TEN_FIELDS, 2000)
    assert 0.0 < result.open_run_s < result.process_s
    assert 10.0 < result.peak_mb < 2000.0
    assert reading.time_stock_reader(path) > 0.0
    assert reading.time_open_run(path) > 0.0


def test_logging_measures_each_step(recorded: RecordedTicks, tmp_path: Path) -> None:
    rows = np.ascontiguousarray(_packed(recorded))
    cost = logging.log_rows(logging.open_ring(), rows, tmp_path / "ours.mcap")
    assert all(value > 0.0 for value in cost)
    assert cost.take + cost.frame + cost.certify + cost.write < cost.processor
    assert logging.log_by_library(rows, tmp_path / "library.mcap") > 0.0
    packed = [
        np.concatenate(list(blocks(scan(tmp_path / name)))).tobytes()
        for name in ("ours.mcap", "library.mcap")
    ]
    assert packed[0] == packed[1] == rows.tobytes()


def _packed(recorded: RecordedTicks) -> Any:
    from rig.kinds.wavebot.tick import WaveBotRow
    from rig.recording.row_layout import layout, leaves, packer
    from rig.recording.runs.mcap_file import row_dtype

    pack, size = packer(WaveBotRow), layout(WaveBotRow).size
    data = bytearray(size * len(recorded.rows))
    for i, row in enumerate(recorded.rows):
        pack(data, i * size, row)
    return np.frombuffer(data, row_dtype(leaves(WaveBotRow)))


def test_the_command_line_is_found() -> None:
    assert start.time_command([*start.rig_command(), "--help"]) > 0.0


# --- results and the runner


def test_a_figure_is_compared_by_its_median_or_its_worst_value() -> None:
    assert figure("a", "s", [1.0, 2.0, 9.0], at_most=2.0).target_met is True
    assert figure("a", "s", [1.0, 2.0, 9.0], at_most=2.0, criterion="worst").target_met is False
    assert figure("a", "x", [30.0, 40.0], at_least=31.0, criterion="worst").target_met is False
    assert figure("a", "%", 95.0, at_least=90.0, at_most=98.0).target_met is True
    assert figure("a", "%", 99.0, at_least=90.0, at_most=98.0).target_met is False
    assert figure("a", "%", 89.0, at_least=90.0, at_most=98.0).limit == ">= 90, <= 98"
    assert figure("a", "%", 89.0, at_least=90.0, at_most=98.0).target_met is False
    assert figure("a", "s", 1.0).target_met is None
    with pytest.raises(ValueError, match="no figure"):
        figure("a", "s", [float("nan")])


def test_quantiles_are_measured_values() -> None:
    assert quantile([3, 1, 2], 0.5) == 2.0
    assert quantile(list(range(1, 1001)), 0.999) == 999.0
    assert quantile([5], 0.99) == 5.0


@pytest.mark.parametrize(
    ("value", "expected"),
    [(0.0, "0"), (1234.0, "1234"), (1234.56, "1235"), (0.012345, "0.0123"), (12.345, "12.3")],
)
def test_numbers_are_rounded_for_people(value: float, expected: str) -> None:
    assert format_number(value) == expected


def fixed_result(short: bool) -> Result:
    figures = (figure("cost", "us", [1.0, 2.5], at_most=1.0), figure("loss", "rows", 0, at_most=0))
    return Result("tick", f"a thing, short: {short}", "2 blocks", figures, ("by hand",))


@pytest.fixture
def run_with(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., int]:
    def run(measure: Callable[[bool], Result], *arguments: str) -> int:
        monkeypatch.setattr(runner, "MEASUREMENTS", {"tick": measure})
        monkeypatch.setattr(runner, "RESULTS", tmp_path)
        monkeypatch.setattr(sys, "argv", ["benchmarks", *arguments])
        return runner.main()

    return run


def test_a_result_is_printed_and_stored(
    run_with: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_with(fixed_result) == 0
    printed = capsys.readouterr().out
    assert "NO" in printed
    assert "targets missed:\n  tick: cost, 1.75 us" in printed
    stored = json.loads((tmp_path / "tick.json").read_text())
    assert [Figure(**one).target_met for one in stored["figures"]] == [False, True]
    table = (tmp_path / "README.md").read_text()
    assert "| cost | 1.75 | 1 - 2.50 | us | <= 1 | NO |" in table
    assert stored["host"]["kernel"] in table


def test_a_short_run_stores_nothing(
    run_with: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_with(fixed_result, "--short", "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["short"] is True
    assert document["results"]["tick"]["description"] == "a thing, short: True"
    assert list(tmp_path.iterdir()) == []


def test_a_failed_measurement_is_reported(
    run_with: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(short: bool) -> Result:
        raise RuntimeError("no such thing here")

    assert run_with(broken) == 1
    assert "not measured: tick: RuntimeError: no such thing here" in capsys.readouterr().err


NEEDS = {"page_memory": "chromium", "lateness": "cyclictest"}


@pytest.mark.realtime
@pytest.mark.long(soak=True)
@pytest.mark.parametrize("name", runner.MEASUREMENTS)
def test_each_benchmark_runs_in_its_short_form(name: str) -> None:
    if (program := NEEDS.get(name)) and shutil.which(program) is None:
        pytest.skip(f"no {program}")
    command = [sys.executable, "-m", "benchmarks", name, "--short", "--json"]
    root = Path(runner.__file__).parents[1]
    done = subprocess.run(command, cwd=root, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["failed"] == []
    assert document["results"][name]["figures"]


def test_every_measurement_has_the_name_of_its_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--help"])
    with pytest.raises(SystemExit, match="0"):
        runner.main()
    printed = capsys.readouterr().out
    for name, measure in runner.MEASUREMENTS.items():
        assert measure.__module__ == f"benchmarks.{name}"
        assert re.search(rf"^  {name} +\S", printed, re.MULTILINE)


def test_the_host_is_described_without_its_name() -> None:
    facts = host.describe_host()
    assert facts["cores"] >= 1
    assert "name" not in facts
    load = host.other_load(host.ProcessorTime.now(), host.ProcessorTime.now())
    assert load["other_work_cores"] >= 0.0


def test_a_result_text_ends_with_its_notes() -> None:
    assert format_table(fixed_result(True)).endswith("note: by hand")
    assert report.format_missed([]) == "every target was met"


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium")
@pytest.mark.realtime  # a replay at 50 times its speed needs more than idle priority
def test_page_and_browser_stay_flat_in_memory_while_they_show_a_run() -> None:
    result = page_memory.measure(short=True)
    assert result.missed == (), format_table(result)
