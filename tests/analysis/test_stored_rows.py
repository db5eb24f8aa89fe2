"""Results of a run come from its stored row table where that is current."""

import json
import os
import shutil
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
import synthetic_runs as synthetic
import xarray

from rig.analysis import stored_rows
from rig.analysis.report import analyse, write_products
from rig.analysis.rows import row_table
from rig.analysis.stored_rows import ROWS, current_table
from rig.analysis.summary import as_json, as_text
from rig.recording.provenance import describe_code

SHAPE = synthetic.Shape()
PLANNED = synthetic.default_rows()[:12]
CODE = {**describe_code(), "dirty": False}


@pytest.fixture(autouse=True)
def code_without_local_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.recording.provenance.describe_code", lambda: CODE)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    data, plan = synthetic.run_rows(PLANNED, SHAPE), synthetic.plan_json(PLANNED, SHAPE)
    written = synthetic.write_run(tmp_path / "run", data[:-40], plan, status="stopped")
    write_products(written)
    return written


def is_computed(run: Path, **options: Any) -> bool:
    """Return whether a process that knows no table computes one."""
    stored_rows.computed_table.cache_clear()
    with mock.patch.object(stored_rows, "row_table", wraps=row_table) as computed:
        current_table(run, **options)
    return bool(computed.called)


def test_a_stored_table_gives_the_summary_of_a_computed_one(run: Path) -> None:
    assert not is_computed(run)
    stored, from_stored = current_table(run), analyse(run).summary
    xarray.testing.assert_equal(stored, row_table(run))
    (run / ROWS).unlink()
    assert is_computed(run)
    computed = analyse(run).summary
    assert as_text(from_stored) == as_text(computed)
    assert json.dumps(as_json(from_stored)) == json.dumps(as_json(computed))


def test_products_from_a_stored_table_keep_it_current(run: Path) -> None:
    before = (run / "rows.csv").read_bytes()
    write_products(run)
    assert (run / "rows.csv").read_bytes() == before
    assert not is_computed(run)


def later(path: Path) -> None:
    os.utime(path, ns=(path.stat().st_atime_ns, path.stat().st_mtime_ns + 1))


@pytest.mark.parametrize("name", ["run.mcap", "config.json"])
def test_a_table_is_computed_anew_after_a_change_of_its_files(run: Path, name: str) -> None:
    later(run / name)
    assert is_computed(run)


def test_a_table_is_computed_anew_by_other_code_and_for_another_state(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    status = json.loads((run / "run.json").read_text())
    rows_done = status | {"rows_done": 3}  # which a run writes after its products
    (run / "run.json").write_text(json.dumps(rows_done))
    assert not is_computed(run)
    (run / "run.json").write_text(json.dumps(status | {"recovered_utc": "2027-01-01"}))
    assert is_computed(run)
    (run / "run.json").write_text(json.dumps(status | {"status": "running"}))
    assert is_computed(run)
    (run / "run.json").write_text(json.dumps(status))
    assert not is_computed(run)
    for change in ({"git": "another"}, {"dirty": True}):
        code = {**CODE, **change}
        monkeypatch.setattr("rig.recording.provenance.describe_code", lambda code=code: code)
        assert is_computed(run)


def test_a_process_computes_a_table_by_changed_code_once(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = {**CODE, "dirty": True}
    monkeypatch.setattr("rig.recording.provenance.describe_code", lambda: code)
    assert is_computed(run)
    with mock.patch.object(stored_rows, "row_table", wraps=row_table) as computed:
        table = current_table(run)
        assert not computed.called
        table.attrs["changed"] = 1
        assert "changed" not in current_table(run).attrs
        before = table["power_ac"].values.tolist()
        current_table(run)["power_ac"].values[:] = 1.0
        assert current_table(run)["power_ac"].values.tolist() == before
        later(run / "run.mcap")
        xarray.testing.assert_equal(current_table(run), table)
        assert computed.called


def test_a_table_with_withheld_rows_is_never_taken_for_the_plain_one(run: Path) -> None:
    assert is_computed(run, incomplete_rows=True)
    write_products(run, incomplete_rows=True)
    assert is_computed(run)
    shutil.copy(run / "rows.csv", run / ROWS)  # no file of that form
    assert is_computed(run)
