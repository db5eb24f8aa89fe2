"""A rig of standard parts from one command: files, check, rehearsal, products, replay."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import pytest
from command_here import rig as rig_here

from rig import laws
from rig.kinds.modular.columns import axis_law
from rig.realtime.sequence import MEASURE
from rig.recording.runs import open_run

BEM = Path(__file__).parents[2] / "configs" / "plants" / "cylinder_bem.nc"


def run_rig(*arguments: object) -> Any:
    """Return the JSON of a command that succeeds."""
    done = rig_here(*arguments, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


def test_the_page_of_laws_lists_the_columns_of_rotating_axes() -> None:
    """Every column of every law of this distribution that has another key or unit there."""
    page = (BEM.parents[2] / "docs" / "reference" / "laws.md").read_text()
    section = page.partition("## Columns of an axis that rotates")[2].partition("## ")[0]
    listed = set(re.findall(r"^\| `(\w+)` \| `(\w+)` \| (\S+) \|$", section, re.MULTILINE))
    own = [laws.own(name) for name in laws.OWN_MODULES]
    turned = {
        (column.key, rotary.key, rotary.unit)
        for law in own
        for column, rotary in zip(law.columns, axis_law(law, "", rotates=True).columns, strict=True)
        if column != rotary
    }
    assert listed == turned


@pytest.mark.parametrize("dof", ["Heave", "Pitch"])
def test_new_rig_is_checked_rehearsed_and_replayed(dof: str, tmp_path: Path) -> None:
    run_rig("new", "rig", "cylinder", "--bem", BEM, "--dof", dof, "--folder", tmp_path)
    campaign = tmp_path / "cylinder" / "campaign.yaml"
    lines = campaign.read_text().split("start:")[0]
    lines += "start: {lead_in_s: 30}\ntiming: {settle_s: 15, periods: 2, interval_s: 32}\n"
    gains = {
        "Heave": ("kp_n_s_per_m", -5000, -3000, "ki_n_per_m", 500),
        "Pitch": ("kp_n_m_s_per_rad", -760, -570, "ki_n_m_per_rad", 160),
    }
    kp, first, second, ki, stiffness = gains[dof]
    campaign.write_text(
        lines
        + "matrix:\n  list:\n"
        + f"    - {{{kp}: {first}, {ki}: 0}}\n    - {{{kp}: {second}, {ki}: {stiffness}}}\n"
    )
    report = run_rig("check", campaign)
    assert report["rows"] == 2
    result = run_rig("run", campaign, "--runs", tmp_path)
    assert (result["status"], result["reason"]) == ("complete", "PLAN_END")
    folder = Path(result["folder"])
    with (folder / "rows.csv").open() as file:
        rows = list(csv.DictReader(file))
    absorbed = [float(row["power_mechanical [W]"]) for row in rows]
    assert all(power < 0.0 for power in absorbed)
    axis = dof.lower()
    # The mean of Kp v^2 is that of the recorded force and velocity; Ki x v has none.
    names = [f"{axis}.estimate.velocity", "plan.row", "plan.phase"]
    data = open_run(folder, fields=names)
    measured = data["plan.phase"].values == MEASURE
    velocity = data[names[0]].values[measured & (data["plan.row"].values == 0)]
    assert absorbed[0] == pytest.approx(first * float((velocity**2).mean()), rel=0.02)
    assert run_rig("replay", folder)["same"] is True
    for command in ("recommend", "spring-map", "surge-damping", "twin", "twoport"):
        refused = rig_here(command, folder)
        assert (refused.returncode, refused.stdout) == (2, "")
        reason = f"{folder}: needs a run of kind wavebot; this one is modular"
        assert refused.stderr == f"rig {command}: {reason}\n"
