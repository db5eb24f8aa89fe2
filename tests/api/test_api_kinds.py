"""`rig.open` of runs of rigs of standard parts, of resumed runs, and of wave calibrations."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pandas
import pytest
from command_here import rig as rig_here
from killed_runs import kill
from mcap.reader import make_reader

import rig
from rig.realtime.sequence import Phase
from rig.recording.runs import open_run

BEM = Path(__file__).parents[2] / "configs" / "plants" / "cylinder_bem.nc"
TIMES = "start: {lead_in_s: 30}\ntiming: {settle_s: 15, periods: 2, interval_s: 32}\n"


def write_campaign(folder: Path, name: str, kis: tuple[int, ...]) -> Path:
    path = folder / f"{name}.yaml"
    matrix = [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": ki} for ki in kis]
    content = {
        "name": name,
        "rig": "wavebot",
        "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
        "start": {"lead_in_s": 20},
        "timing": {"settle_s": 4, "interval_s": 10},
        "matrix": {"list": matrix},
    }
    path.write_text(json.dumps(content))
    return path


def test_a_modular_rig(tmp_path: Path) -> None:
    done = rig_here("new", "rig", "cylinder", "--bem", BEM, "--dof", "Pitch", "--folder", tmp_path)
    assert done.returncode == 0, done.stderr
    path = tmp_path / "cylinder" / "campaign.yaml"
    rows = "\n".join(
        f"    - {{kp_n_m_s_per_rad: {kp}, ki_n_m_per_rad: {ki}}}"
        for kp, ki in ((-760, 0), (-570, 160))
    )
    path.write_text(f"{path.read_text().split('start:')[0]}{TIMES}matrix:\n  list:\n{rows}\n")
    run = rig.rehearse(path, out=tmp_path / "runs", progress=False)
    assert (run.kind, run.outcome.status) == ("modular", "complete")
    written = pandas.read_csv(run.path / "rows.csv", index_col="row")
    powers = [name for name in written if name.startswith("power_") and name.endswith(" [W]")]
    assert powers
    for name in powers:
        ours = run.rows[name.removesuffix(" [W]")].to_numpy()
        np.testing.assert_array_equal(ours, written[name].to_numpy())
    raw = open_run(run.path, rows=[1])
    tree = run.sel(row=1)
    assert set(tree.plan.phase.values) == {Phase(n).name for n in set(raw["plan.phase"].values)}
    for field in raw.data_vars:
        group, _, leaf = str(field).rpartition(".")
        ours = tree[f"{group}/{leaf}".replace(".", "/").lstrip("/")].values
        if ours.dtype != object:
            np.testing.assert_array_equal(ours, raw[field].values, err_msg=str(field))
    assert run.best.loc[run.best.index[0]].label in repr(run)


def test_a_resumed_run_has_the_ticks_and_rows_of_all_its_stages(tmp_path: Path) -> None:
    path = write_campaign(tmp_path, "resumed", (0, 2000, 4000))
    whole = rig.rehearse(path, out=tmp_path / "runs", progress=False)
    killed = tmp_path / "runs" / whole.name
    for product in killed.glob("*"):
        if product.suffix in (".csv", ".nc", ".png", ".pdf", ".txt") or product.name in (
            "summary.json",
            "certificate.json",
        ):
            product.unlink()
    kill(killed, 2 / 3)
    before = rig.open(killed)
    assert before.outcome.status == "abandoned"
    assert not before.rows.state.eq("complete").all()
    done = rig_here("run", "--resume", killed, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    run = rig.open(killed)
    assert run.outcome.complete
    assert run.rows.state.tolist() == ["complete"] * 3
    counts = []
    for file in (killed / "earlier-1.mcap", killed / "run.mcap"):
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        counts.append(summary.statistics.message_count)
    assert run.log.sizes["time"] == sum(counts)
    assert (np.diff(run.log.time.values) > 0).all()
    assert set(run.sel(row=2).plan.row.values) == {2}
    written = pandas.read_csv(killed / "rows.csv", index_col="row")
    assert run.rows.power_dc.tolist() == written["power_dc [W]"].tolist()


def test_a_wave_calibration_has_no_rows(tmp_path: Path) -> None:
    path = tmp_path / "waves.yaml"
    sea = {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5}
    timing = {"device": "absent", "start": {"lead_in_s": 20}, "timing": {"periods": 4}}
    path.write_text(json.dumps({"name": "waves", "rig": "wavebot", "sea": sea} | timing))
    run = rig.rehearse(path, out=tmp_path, progress=False)
    assert run.outcome.complete
    assert run.rows.empty
    assert run.best.empty
    assert "wave_calibration" in run.tables
    with pytest.raises(rig.RigError, match=r"a wave calibration has no row table"):
        _ = run.table
    assert "Complete" in repr(run)
    assert "<dl>" in run._repr_html_()


def test_a_single_mcap_file_is_a_run(tmp_path: Path) -> None:
    path = write_campaign(tmp_path, "single", (2000,))
    run = rig.rehearse(path, out=tmp_path / "runs", progress=False)
    alone = tmp_path / "alone" / "run.mcap"
    alone.parent.mkdir()
    shutil.copy(run.path / "run.mcap", alone)
    opened = rig.open(alone)
    pandas.testing.assert_frame_equal(opened.rows, run.rows)
    assert (opened.name, opened.kind) == (run.name, run.kind)
    assert opened.config.as_dict() == run.config.as_dict()
