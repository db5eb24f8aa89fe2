"""Opening runs: fields, rows, units, and the same numbers as with the stock reader."""

import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import record_files as files
from command_here import rig
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from rig.api.run_lookup import find_run
from rig.kinds.wavebot.tick import WaveBotRow
from rig.recording import row_layout
from rig.recording.runs import RunError, list_runs, open_run, reader


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "20260504-093000"
    folder.mkdir()
    config = json.dumps({"name": "default"}).encode()
    out = files.writer(folder / "run.mcap", **{"config.json": config})
    out.append(files.rows(2500).tobytes())
    out.attach("status.json", b'{"status": "complete", "mode": "rehearsal", "reason": "PLAN_END"}')
    out.attach("code.json", b'{"version": "0.1.0", "git": "abc"}')
    out.finish()
    return folder


def test_all_fields_with_their_units(run: Path) -> None:
    data = open_run(run)
    expected = files.rows(2500)
    assert list(data.data_vars) == [n for n in files.DTYPE.names or () if n != "time"]
    for name in data.data_vars:
        assert np.array_equal(data[name].values, expected[str(name)])
    assert np.array_equal(data["time"].values, expected["time"])
    for leaf in row_layout.leaves(WaveBotRow):
        assert data[leaf.name].attrs["units"] == leaf.unit
    assert data.attrs["run"] == "test"
    assert data.attrs["campaign"] == "default"
    assert data.attrs["mode"] == "rehearsal"
    assert data.attrs["code_version"] == "0.1.0"
    assert data.attrs["started_utc"] == "2025-10-09T08:53:20Z"


@pytest.mark.parametrize(
    ("fields", "names"),
    [
        ("load.lcb", {"load.lcb"}),
        (
            ["heave.estimate"],
            {f"heave.estimate.{n}" for n in ("position", "velocity", "acceleration")},
        ),
        (["*.mean_ac", "wave"], {"power.mean_ac", "wave.elevation"}),
        (["*.age"], {"load.age", "spring_sense.age", "power_sense.age", "probes.age", "panel.age"}),
    ],
)
def test_fields_by_name_prefix_and_pattern(run: Path, fields: object, names: set[str]) -> None:
    assert set(open_run(run, fields).data_vars) == names  # type: ignore[arg-type]


def test_an_unknown_field_is_reported_with_similar_ones(run: Path) -> None:
    with pytest.raises(
        KeyError, match=r"no field 'heave.estimate.positon'.*heave\.estimate\.position"
    ):
        open_run(run, ["heave.estimate.positon"])


def test_rows_by_id(run: Path) -> None:
    data = open_run(run, "load.lcb", rows=[3, 24])
    assert data["time"].values.tolist() == pytest.approx(
        [t * 1e-3 for t in (*range(300, 400), *range(2400, 2500))]
    )
    assert open_run(run, "load", rows=7).sizes["time"] == 100
    with pytest.raises(TypeError, match="row ids must be whole numbers, not 'three'"):
        open_run(run, "load", rows=[3, "three"])  # type: ignore[list-item]
    with pytest.raises(KeyError, match=r"no row 99 in this run \(rows: 0 to 24\)"):
        open_run(run, rows=99)


def test_labels_are_small_where_they_fit(tmp_path: Path) -> None:
    data = files.rows(1000)
    labels = [leaf.name for leaf in row_layout.leaves(WaveBotRow) if leaf.unit in ("index", "flag")]
    assert {"plan.row", "plan.phase", "safety.mode", "heave.warned"} <= set(labels)
    for name in labels:
        data[name] = np.arange(1000) % 7 - 1
    data["plan.row"][:2] = 32767, -32768
    data["plan.attempt"][600] = 32768
    data["safety.mode"][700] = -32769
    found = open_run(files.write(tmp_path / "run.mcap", data, flush_every=100))
    wide = {name for name in labels if found[name].dtype == np.int64}
    assert wide == {"plan.attempt", "safety.mode"}
    assert {found[name].dtype for name in set(labels) - wide} == {np.dtype(np.int16)}
    assert found["heave.sense.counts"].dtype == np.int64
    for name in found.data_vars:
        assert np.array_equal(found[name].values, data[name])


def test_columns_are_in_memory_once(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    peak: dict[str, reader.Column] = {}
    columns = reader.columns
    monkeypatch.setattr(reader, "columns", lambda *a: peak.update(columns(*a)) or peak)
    data = open_run(run, ["load", "plan.row"])
    for name, column in peak.items():
        assert np.shares_memory(data[name].values, column), name
    assert list(peak) == ["time", *data.data_vars]


def test_the_fast_reader_equals_the_stock_reader(run: Path) -> None:
    with (run / "run.mcap").open("rb") as file:
        stock = b"".join(m.data[4:] for _, _, m in make_reader(file).iter_messages())
    expected = np.frombuffer(stock, files.DTYPE)
    data = open_run(run)
    for name in data.data_vars:
        assert np.array_equal(data[name].values, expected[str(name)])


def write_elsewhere(path: Path, data: Any, compression: CompressionType) -> None:
    """Write rows with the stock writer, with other messages between them."""
    with path.open("wb") as file:
        out = Writer(file, chunk_size=50_000, compression=compression)
        out.start("ros2")
        name, text = row_layout.schema(WaveBotRow)
        schema = out.register_schema(name, "ros2msg", text.encode())
        other = out.register_channel("/words", "json", 0)
        channel = out.register_channel("/row", "cdr", schema)
        for i in range(len(data)):
            message = row_layout.CDR_HEADER + data[i : i + 1].tobytes()
            out.add_message(channel, i, message, i, i)
            if i % 100 == 0:
                out.add_message(other, i, b"{}", i)
        out.finish()


@pytest.mark.parametrize("compression", list(CompressionType))
def test_files_of_other_writers_are_read(tmp_path: Path, compression: CompressionType) -> None:
    data = files.rows(700)
    path = tmp_path / "other.mcap"
    write_elsewhere(path, data, compression)
    for _ in ("whole", "without its end"):
        found = open_run(path, ["load.lcb", "tick"])
        assert np.array_equal(found["load.lcb"].values[:600], data["load.lcb"][:600])
        path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.99)])


@pytest.mark.parametrize("compression", [None, CompressionType.LZ4])
def test_selected_fields_are_those_of_whole_rows(
    tmp_path: Path, compression: CompressionType | None
) -> None:
    path, data = tmp_path / "run.mcap", files.rows(3000)
    if compression is None:
        files.write(path, data)
    else:
        write_elsewhere(path, data, compression)
    source = reader.open_files(path)
    names = ["tick", "time", "plan.row", "timing.skipped", "heave.command.force"]
    found = np.concatenate(list(reader.blocks(source, fields=["heave.command.force", "plan.row"])))
    assert set(found.dtype.names or ()) == set(names)
    assert found.dtype.itemsize == 8 * len(names)
    assert all(np.array_equal(found[name], data[name]) for name in names)


def test_a_killed_writers_parts_are_read_as_one_run(tmp_path: Path) -> None:
    files.write(tmp_path / "run.mcap.part0", files.rows(1000), finish=False)
    files.write(tmp_path / "run.mcap.part1", files.rows(1000, 950), finish=False)
    files.write(tmp_path / "run.mcap.part10", files.rows(10, 1950), finish=False)
    assert open_run(tmp_path, "load.lcb")["time"].size == 1960


def test_an_empty_run_has_no_ticks(tmp_path: Path) -> None:
    files.write(tmp_path / "run.mcap", files.rows(0))
    assert open_run(tmp_path, ["load"])["load.lcb"].size == 0


def test_invalid_runs_are_reported(tmp_path: Path) -> None:
    for path, problems in ((tmp_path, "no run.mcap and no part"), (tmp_path / "x", "no such run")):
        with pytest.raises(RunError, match=problems):
            open_run(path)


def test_reading_is_fast(tmp_path: Path) -> None:
    path = files.write(tmp_path / "run.mcap", files.rows(200_000), flush_every=2000)
    begin = time.perf_counter()
    open_run(path, ["load", "heave.estimate"])
    assert time.perf_counter() - begin < 3.0  # 0.2 s on an idle machine; detects the slow method


def test_lists_of_runs(tmp_path: Path) -> None:
    good = tmp_path / "b_good"
    good.mkdir()
    files.write(good / "run.mcap", files.rows(10))
    status_file = {"status": "complete", "reason": "PLAN_END", "rows_done": 66, "rows_planned": 66}
    status_file |= {"mode": "hil", "started_utc": "2026-05-04T09:30:00Z"}
    (good / "run.json").write_text(json.dumps(status_file))
    (good / "config.json").write_text('{"name": "default"}')
    for name in ("empty_folder", "no_end", "zero_bytes", "rubbish", "bad_json"):
        (tmp_path / name).mkdir()
    files.write(tmp_path / "no_end" / "run.mcap.part0", files.rows(10), finish=False)
    (tmp_path / "zero_bytes" / "run.mcap").touch()
    (tmp_path / "rubbish" / "run.mcap").write_bytes(b"not a log at all")
    files.write(tmp_path / "bad_json" / "run.mcap", files.rows(10))
    (tmp_path / "bad_json" / "run.json").write_text("{")
    (tmp_path / "notes.txt").write_text("no run")
    listed = {run.path.name: run for run in list_runs(tmp_path)}
    assert len(listed) == 6
    run = listed["b_good"]
    assert (run.mode, run.campaign, run.rows_done, run.status) == ("hil", "default", 66, "complete")
    assert run.size == (good / "run.mcap").stat().st_size
    assert not run.problem
    problems = {name: listed[name].problem for name in listed}
    assert "no run.mcap" in problems["empty_folder"]
    assert "no run.json" in problems["no_end"]
    assert "empty" in problems["zero_bytes"]
    assert "not an MCAP file" in problems["rubbish"]
    assert "run.json is not readable" in problems["bad_json"]
    assert listed["no_end"].started_utc == "2025-10-09T08:53:20Z"
    assert list_runs(tmp_path / "nowhere") == []


def test_a_refused_run_is_listed_with_the_reason_of_its_status(tmp_path: Path) -> None:
    status_file = {"status": "refused", "reason": "the host did not grant core", "run": "x"}
    for name, files_of in (("x", {}), ("y", {"run.mcap": b""})):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "run.json").write_text(json.dumps(status_file | {"record": "unfinished"}))
        (folder / "config.json").write_text("{}")
        for file, content in files_of.items():
            (folder / file).write_bytes(content)
    before, with_record = list_runs(tmp_path)
    assert (before.status, before.reason) == ("refused", "the host did not grant core")
    assert (before.problem, before.record) == ("", "")
    assert with_record.problem == "the MCAP file is empty"
    done = rig("runs", "--runs", tmp_path)
    assert "the host did not grant core" in done.stdout
    assert "no run.mcap" not in done.stdout


def test_last_skips_refused_runs_without_a_record(tmp_path: Path) -> None:
    for name, status in (("20260504-093000", "complete"), ("20260504-100000", "refused")):
        folder = tmp_path / name
        folder.mkdir()
        facts = {"status": status, "reason": "no such interface: can0", "run": name}
        (folder / "run.json").write_text(json.dumps(facts | {"campaign": "default"}))
        (folder / "config.json").write_text("{}")
    measured, refused = sorted(tmp_path.iterdir())
    files.write(measured / "run.mcap", files.rows(10))
    for name in ("last", "default"):
        assert find_run(Path(name), tmp_path) == measured
    for command in (["show"], ["plot"], ["recover"], ["run", "--resume"]):
        done = rig(*command, refused.name, "--runs", tmp_path)
        assert done.returncode != 0
        assert "the run was refused and has no record: no such interface: can0" in done.stderr
    (measured / "run.mcap").unlink()
    measured.joinpath("run.json").unlink()
    measured.joinpath("config.json").unlink()
    measured.rmdir()
    assert find_run(Path("last"), tmp_path) == refused  # there is no other


def process_start(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19])


def test_a_run_without_its_supervisor_is_abandoned(tmp_path: Path) -> None:
    pid = os.getpid()
    started = process_start(pid)
    status_file: dict[str, tuple[dict[str, object], bool]] = {
        "alive": ({"pid": pid, "pid_started": started}, False),
        "pid_taken_by_another": ({"pid": pid, "pid_started": started - 1}, False),
        "gone": ({"pid": 2**22 + 1, "pid_started": 1}, False),
        "old_and_finished": ({}, True),
        "old_and_unfinished": ({}, False),
    }
    for name, (fields, finish) in status_file.items():
        folder = tmp_path / name
        folder.mkdir()
        files.write(folder / "run.mcap.part0", files.rows(10), finish=finish)
        (folder / "config.json").write_text("{}")
        (folder / "run.json").write_text(json.dumps({"status": "running"} | fields))
    listed = {run.run: run for run in list_runs(tmp_path)}
    assert {name for name, run in listed.items() if run.status == "running"} == {
        "alive",
        "old_and_unfinished",
    }
    assert {run.status for run in listed.values()} == {"running", "abandoned"}
    assert not listed["alive"].problem
    assert "supervisor is gone" in listed["gone"].problem


def test_runs_are_in_the_order_of_their_starts(tmp_path: Path) -> None:
    starts = {"b": "2026-05-04T09:30:00Z", "a": "2026-05-04T09:30:00.5+00:00", "rubbish": "soon"}
    for name, start in starts.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.json").write_text(json.dumps({"started_utc": start}))
        (tmp_path / name / "config.json").write_text("{}")
    for name in ("20260504T093001Z_x", "20260504T092959Z_x"):
        (tmp_path / name).mkdir()
    assert [run.path.name for run in list_runs(tmp_path)] == [
        "rubbish",
        "20260504T092959Z_x",
        "b",
        "a",
        "20260504T093001Z_x",
    ]
