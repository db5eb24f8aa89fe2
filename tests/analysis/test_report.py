"""All products of complete, partial and crashed runs."""

import json
import os
import re
import signal
from itertools import combinations
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
import synthetic_runs as synthetic
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread

from rig.analysis import report, traces
from rig.analysis.page import has_few_chosen
from rig.analysis.report import after_run, analyse, write_products
from rig.analysis.rows import COMPLETE, NOT_RUN, row_table
from rig.analysis.summary import as_text
from rig.analysis.surfaces import draw_surfaces
from rig.analysis.traces import decimate, write_traces
from rig.config.problems import format_rows
from rig.kinds.wavebot.tick.reasons import WaveBotReason
from rig.presentation.phrases import (
    format_power,
    format_signed,
    format_utc,
    mode_stamp,
    reason_text,
)
from rig.realtime.limits import LimitFlag
from rig.realtime.reasons import Reason
from rig.realtime.sequence import Phase
from rig.recording.calibration_changes import PRODUCTS
from rig.recording.runs import RunError

SHAPE = synthetic.Shape(noise=10.0, wander=1.0)
ROWS = synthetic.default_rows()


@pytest.fixture(scope="module")
def complete_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "20260504-093000-default"
    plan = synthetic.plan_json(ROWS, SHAPE)
    return synthetic.write_run(folder, synthetic.run_rows(ROWS, SHAPE), plan)


@pytest.fixture(scope="module")
def products(complete_run: Path) -> dict[str, Path]:
    return {path.name: path for path in write_products(complete_run)}


def test_all_products_exist(products: dict[str, Path]) -> None:
    assert set(products) == {
        "rows.csv",
        "rows.nc",
        "surfaces.png",
        "surfaces_sliced.png",
        "effects.csv",
        "summary.txt",
        "summary.json",
        "summary.pdf",
        "summary.png",
    }
    assert all(path.stat().st_size > 500 for path in products.values())


def draw_nothing(*_: object) -> list[Path]:
    return []


def kill_this_process(*_: object) -> list[Path]:
    os.kill(os.getpid(), signal.SIGKILL)
    return []


def test_an_error_in_a_drawing_process_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = ROWS[:4]
    run = synthetic.write_run(
        tmp_path / "run", synthetic.run_rows(rows, SHAPE), synthetic.plan_json(rows, SHAPE)
    )
    (run / "surfaces.png").mkdir()
    outcome: Any = None
    monkeypatch.setattr(report, "write_page", draw_nothing)
    assert "surfaces.png: Is a directory" in after_run(run, outcome).trouble
    (run / "surfaces.png").rmdir()
    monkeypatch.setattr(report, "write_page", kill_this_process)
    assert "a process that drew pictures was killed" in after_run(run, outcome).trouble
    monkeypatch.setattr(report, "write_page", draw_nothing)
    assert after_run(run, outcome).trouble == ""


def test_a_changed_calibration_makes_every_product_stale(products: dict[str, Path]) -> None:
    assert {*products, "bars.png"} == set(PRODUCTS)


def test_the_page_is_one_a4_page(products: dict[str, Path]) -> None:
    data = products["summary.pdf"].read_bytes()
    assert len(re.findall(rb"/Type /Page\b", data)) == 1
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", data)
    assert box is not None
    assert [float(side) for side in box.groups()] == pytest.approx([595.4, 841.7], abs=0.5)
    assert imread(products["summary.png"]).std() > 0.05


def test_summary_contains_conditions_and_results(products: dict[str, Path]) -> None:
    text = products["summary.txt"].read_text()
    for part in (
        "REHEARSAL: simulated plant",
        "Complete: the plan ran to its end.",
        "66 of 66 rows complete.",
        "regular, amplitude 0.127 m, 0.5 Hz",
        "0.1.0 (0123abc)",
        "Virtual clock: every tick ran in order",
        "Alarms\n  none",
    ):
        assert part in text
    summary = json.loads(products["summary.json"].read_text())
    best = {(o["power"], o["spring_rate_n_per_m"]): o for o in summary["optima"]}
    assert best["ac", 490.9]["kp_n_s_per_m"] == -2500.0
    assert best["dc", -5715.0]["mean_w"] == pytest.approx(-15.0, abs=3.0)
    assert best["ac", 490.9]["standard_error_w"] > 0.0


def test_products_are_reproducible(
    complete_run: Path, products: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("rows.csv", "summary.txt", "summary.json")
    before = {name: products[name].read_bytes() for name in names}
    monkeypatch.setattr(Figure, "savefig", lambda *args, **kwargs: None)  # only texts are compared
    write_products(complete_run)
    assert before == {name: products[name].read_bytes() for name in names}


def test_crashed_run_has_products(tmp_path: Path) -> None:
    data = synthetic.run_rows(ROWS, SHAPE)
    at = np.flatnonzero((data["plan.row"] == 9) & (data["plan.phase"] == Phase.MEASURE))
    data["heave.estimate.position"][data["plan.row"] == 4] -= 0.0072
    third = np.flatnonzero((data["plan.row"] == 3) & (data["plan.phase"] == Phase.MEASURE))
    data["heave.command.limited"][third] = LimitFlag.CURRENT_PEAK
    cut = np.delete(data[: at[100]], third[5:8])
    synthetic.write_run(tmp_path, cut, synthetic.plan_json(ROWS, SHAPE), finish=False)
    with (tmp_path / "run.mcap").open("ab") as file:
        file.write(b"\x06torn")
    write_products(tmp_path)
    text = (tmp_path / "summary.txt").read_text()
    for part in (
        "No end recorded",
        "8 of 66 rows complete",
        "Record incomplete: at least 3 of ",
        "the record was not finished by its writer, 5 torn bytes at its end",
        "mean position beyond 5 mm in row 4: −7.2 mm in row 4",
        "force limited (current peak) in row 3",
        "row 3 is withheld: 3 of 1000 ticks missing from the record (--incomplete-rows",
        "row 9 was cut short (the log ends here)",
        "No timing certificate",
    ):
        assert part in text


def test_stop_is_reported_with_time_row_and_phase(tmp_path: Path) -> None:
    data = synthetic.run_rows(ROWS, SHAPE)
    plan = synthetic.plan_json(ROWS, SHAPE)
    at = np.flatnonzero((data["plan.row"] == 2) & (data["plan.phase"] == Phase.SETTLE))[10]
    when = f"stopped {at * SHAPE.dt:.3f} s after its start, row 2 (settle)"
    data["safety.reason"][at:] = WaveBotReason.SPRING_STROKE
    run = synthetic.write_run(tmp_path / "a", data, plan, status="fault", reason="SPRING_STROKE")
    summary = analyse(run).summary
    assert summary.stopped == when
    assert f"rows complete; {when}." in as_text(summary)
    data["safety.reason"][40:] = Reason.OPERATOR_STOP
    run = synthetic.write_run(tmp_path / "b", data, plan, status="stopped", reason="OPERATOR_STOP")
    assert analyse(run).summary.stopped.endswith("before the first row (lead-in)")


def test_a_run_that_measured_nothing(tmp_path: Path) -> None:
    data = synthetic.run_rows(ROWS[:1], SHAPE)[:50]
    status = {"status": "fault", "reason": "NOT_CALM", "mode": "hardware"}
    synthetic.write_run(tmp_path, data, synthetic.plan_json(ROWS, SHAPE), **status)
    write_products(tmp_path)
    text = (tmp_path / "summary.txt").read_text()
    assert "Stopped by a fault: the body moved during the tare (NOT_CALM)." in text
    assert "0 of 66 rows complete" in text
    assert "[HARDWARE]" in text
    (tmp_path / "none").mkdir()
    synthetic.write_run(tmp_path / "none", data, {})
    write_products(tmp_path / "none")
    assert "no row was measured" in (tmp_path / "none" / "summary.txt").read_text()


def test_an_adaptive_campaign_with_few_rows_has_no_surfaces(tmp_path: Path) -> None:
    """From a quarter of the candidates on they are drawn; the page is complete without them."""
    plan = synthetic.plan_json(ROWS, SHAPE)
    for number, drawn in ((16, False), (17, True)):  # of 66 candidates
        run = synthetic.write_run(
            tmp_path / str(number), synthetic.run_rows(ROWS[:number], SHAPE), plan
        )
        summary = analyse(run).summary._replace(choices=("12 rows were chosen",))
        assert (summary.rows_done, summary.few_chosen) == (number, not drawn)
        with mock.patch.object(report, "summarise_rows") as found:
            found.return_value = row_table(run), summary
            names = {path.name for path in write_products(run)}
        assert ("surfaces.png" in names) == drawn
        assert "summary.png" in names


def test_an_adaptive_campaign_whose_rows_span_no_surface_has_none(tmp_path: Path) -> None:
    """A third of the candidates, all at one Kp; in a panel beside a surface they are dots."""
    plan = synthetic.plan_json(ROWS, SHAPE)
    run = synthetic.write_run(tmp_path / "run", synthetic.run_rows(ROWS, SHAPE), plan)
    table, summary = row_table(run), analyse(run).summary
    springs = table["spring_rate"].values
    at_one_kp = table["kp"].values == table["kp"].values[0]
    one_spring = springs == np.unique(springs)[0]

    def measured(rows: Any) -> Any:
        state = np.where(rows, COMPLETE, NOT_RUN)
        return table.assign(state=("row", state))

    chosen = summary._replace(choices=("some rows were chosen",))
    assert has_few_chosen(chosen, measured(at_one_kp))
    assert not has_few_chosen(summary, measured(at_one_kp))
    assert not has_few_chosen(chosen, measured(at_one_kp | one_spring))
    figure = Figure(layout="constrained")
    draw_surfaces(figure, measured(at_one_kp | one_spring), 8.0)
    texts = [[text.get_text() for text in axes.texts] for axes in figure.axes]
    assert sum("too few points for a surface" in each for each in texts) == 4  # a station each
    lines = [line for axes in figure.axes for line in axes.lines]
    assert not any(line.get_marker() == "x" or line.get_linestyle() == "-" for line in lines)


def test_refused_run_reports_its_reason(tmp_path: Path) -> None:
    why = "the host did not grant what the rig file requires"
    plan = synthetic.plan_json(ROWS, SHAPE)
    data = synthetic.run_rows(ROWS[:1], SHAPE)[:0]
    synthetic.write_run(tmp_path, data, plan, status="refused", reason=why)
    summary = analyse(tmp_path).summary
    assert (summary.ending, summary.reason) == ("Refused", why)


def test_rows_without_a_tare_raise_an_alarm(tmp_path: Path) -> None:
    data = synthetic.run_rows(ROWS[:3], SHAPE)
    data["tare.samples"] = 0
    synthetic.write_run(tmp_path, data, synthetic.plan_json(ROWS, SHAPE))
    (alarm,) = (text for text in analyse(tmp_path).summary.alarms if "tare" in text)
    assert alarm.startswith("no tare was taken before rows 0-2")


def test_single_file_can_be_summarised(complete_run: Path, tmp_path: Path) -> None:
    alone = tmp_path / "mailed.mcap"
    alone.write_bytes((complete_run / "run.mcap").read_bytes())
    summary = analyse(alone).summary
    assert (summary.campaign, summary.mode, summary.rows_done) == ("default", "rehearsal", 66)
    assert [p.name for p in tmp_path.iterdir()] == ["mailed.mcap"]


def test_run_in_progress(tmp_path: Path) -> None:
    plan = synthetic.plan_json(ROWS, SHAPE)
    data = synthetic.run_rows(ROWS[:3], SHAPE)
    synthetic.write_run(tmp_path, data, plan, status="running", reason="")
    assert analyse(tmp_path).summary.reason.startswith("the record just stops")


def test_missing_record_raises_run_error(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"no run\.mcap"):
        write_products(tmp_path)


def test_many_spring_rates_fit(tmp_path: Path) -> None:
    rows = []
    for rate in (8000.0, 4000.0, 490.9, -3000.0, -5715.0):
        for kp in (-1000.0, -2000.0):
            for ki in (0.0, 1000.0):
                power = dict.fromkeys(("mechanical_1", "mechanical_2", "ac", "dc"), kp / 100.0)
                rows.append(synthetic.Row(len(rows), 0, rate, kp, ki, power))
    shape = synthetic.Shape(periods=1)
    plan = synthetic.plan_json(rows, shape)
    synthetic.write_run(tmp_path, synthetic.run_rows(rows, shape), plan)
    write_products(tmp_path)
    assert len(row_table(tmp_path)["row"]) == 20


def test_many_spring_rates_and_drive_settings_fit(tmp_path: Path) -> None:
    rows = []
    power = dict.fromkeys(("mechanical_1", "mechanical_2", "ac", "dc"), -9.0)
    for rate in (8000.0, 4000.0, 490.9, -3000.0, -5715.0):
        for bus in (60.0, 90.0):
            for period in (50e-6, 200e-6):
                more = {"bus_voltage": bus, "switching_period": period}
                rows.append(synthetic.Row(len(rows), 0, rate, -2000.0, 0.0, power, more))
    shape = synthetic.Shape(periods=2, settle=5, tail=2, lead_in=10, wander=1.0)
    plan = synthetic.plan_json(rows, shape)
    synthetic.write_run(tmp_path, synthetic.run_rows(rows, shape), plan)
    written = {path.name for path in write_products(tmp_path)}
    assert {"bars.png", "effects.csv"} <= written
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert {tuple(o["further"]) for o in summary["optima"]} == {("bus_voltage", "switching_period")}
    assert {tuple(o["further_without_effect"]) for o in summary["optima"]} >= {
        ("bus_voltage", "switching_period")
    }
    text = (tmp_path / "summary.txt").read_text()
    assert "consumed, ± standard error by scatter of wave periods)" in text
    assert "no effect of bus voltage, switching period" in text
    assert "power differs by less than 1 % or by no more than its errors" in text
    assert [each["power"] for each in summary["effects"]] == [
        "dc", "ac", "mechanical_2", "mechanical_1",
    ]  # fmt: skip


def test_traces(complete_run: Path, tmp_path: Path) -> None:
    picture = imread(write_traces(complete_run, tmp_path / "all.png"))
    assert picture.std() > 0.05
    write_traces(complete_run, tmp_path / "some.png", ["power.*", "plan.phase"], rows=[3, 7])
    with pytest.raises(KeyError, match="no field 'nothing'"):
        write_traces(complete_run, tmp_path / "x.png", ["nothing"])
    with pytest.raises(KeyError, match="no row 400"):
        write_traces(complete_run, tmp_path / "x.png", rows=400)


def test_constant_fields_are_listed_and_not_drawn(complete_run: Path, tmp_path: Path) -> None:
    every = imread(write_traces(complete_run, tmp_path / "all.png", ["heave.*"]))
    assert every.shape[0] < 1.1 * every.shape[1]  # no tall strip
    data = {"a": np.ones(5), "b": np.arange(5.0), "c": np.full(5, np.nan), "d": np.zeros(5)}
    assert traces._panel_label(["heave.estimate.position", "surge.estimate.position"], "m") == (
        "position, m"
    )
    assert traces._panel_label(["power.ac", "power.dc"], "W") == "power, W"
    assert traces._panel_label(["plan.phase"], "index") == "phase"
    constant = traces._constant_fields(data, list(data))
    assert constant == ["a", "d"]
    units = {"a": "N*s/m", "d": "flag"}
    assert traces._format_constants(data, constant, units) == "constant: a 1 N·s/m, d 0"
    assert traces._constant_fields(data, ["a", "d"]) == []  # otherwise the picture would be empty
    assert traces._format_constants(data, [], units) == ""


def test_phases_have_distinguishable_colours() -> None:
    assert set(traces._PHASE_COLOURS) == set(Phase)
    colours = [np.array(to_rgb(shade)) for shade in (*traces._PHASE_COLOURS.values(), "white")]
    for one, other in combinations(colours, 2):
        assert np.linalg.norm(one - other) > 0.08


def test_no_peak_is_lost_by_decimation() -> None:
    random = np.random.default_rng(2)
    values = random.normal(size=100_000)
    values[77_777] = 50.0
    values[33_333] = -60.0
    time = np.arange(100_000.0)
    x, y = decimate(time, values, 500)
    assert len(x) == 1000
    assert (y.max(), y.min()) == (50.0, -60.0)
    assert (np.diff(x) >= 0.0).all()
    assert decimate(time[:900], values[:900], 500)[1].size == 900


def test_phrases() -> None:
    assert reason_text("POSITION") == "the position limit was reached"
    assert reason_text("something new") == "something new"
    assert mode_stamp("hil").startswith("HIL")
    assert mode_stamp("") == "MODE NOT RECORDED"
    assert format_signed(-2500.0) == "−2500"
    assert format_signed(-0.2) == "0"
    assert format_power(-55.04, 0.26) == "−55.0 ± 0.3 W"
    assert format_power(-55.04, 0.012) == "−55.04 ± 0.01 W"
    assert format_power(-231.2, 12.0) == "−231 ± 12 W"
    assert format_power(-55.04, 0.0) == "−55.04 ± <0.01 W"  # an error is never exactly zero
    assert format_power(-55.04) == "−55.0 W"
    assert format_power(-1.234e-4, 4.2e-6) == "−0.000123 ± 0.000004 W"
    assert format_power(-0.01234, 0.0) == "−0.0123 ± <0.0001 W"
    assert format_power(0.01234) == "+0.0123 W"
    assert format_power(-0.01234, 0.02) == "−0.01 ± 0.02 W"  # digits within the error are noise
    assert format_power(0.0, 0.0) == "0.00 ± <0.01 W"
    assert format_utc("2026-11-21T10:41:01.456806+00:00") == "2026-11-21 10:41:01 UTC"
    assert format_utc("not recorded") == "not recorded"
    assert format_rows([3, 1, 2, 9]) == "rows 1-3, 9"
    assert format_rows([4]) == "row 4"
