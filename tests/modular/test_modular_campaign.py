"""A rig of standard parts from one command: files, check, rehearsal, products, replay."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import pytest
from command_here import rig as rig_here

from docs.generate import law_list
from rig.realtime.sequence import MEASURE
from rig.recording.runs import open_run

BEM = Path(__file__).parents[2] / "configs" / "plants" / "cylinder_bem.nc"


def run_rig(*arguments: object) -> Any:
    """Return the JSON of a command that succeeds."""
    done = rig_here(*arguments, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


TURNED = {
    ("kp_n_s_per_m", "kp_n_m_s_per_rad", "N*m*s/rad"),
    ("ki_n_per_m", "ki_n_m_per_rad", "N*m/rad"),
    ("km_kg", "km_kg_m2", "kg*m^2"),
    ("quadratic_n_s2_per_m2", "quadratic_n_m_s2_per_rad2", "N*m*s^2/rad^2"),
    ("coulomb_n", "coulomb_n_m", "N*m"),
    ("goal_m", "goal_rad", "rad"),
}
"""Columns of the laws with another key on an axis that rotates: the key and the unit there."""


def test_the_page_of_laws_lists_the_columns_of_rotating_axes() -> None:
    sections = law_list.page().split("Columns of the gain matrix")[1:]
    columns = "".join(each.partition("Parameters below")[0] for each in sections)
    pattern = r"^\| `(\w+)` \| `(\w+)` \| `[^`]+` \| `([^`]+)` \|"
    assert set(re.findall(pattern, columns, re.MULTILINE)) == TURNED


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
        if command == "recommend":
            reason += (
                "; on any rig with power stations, a campaign with `adaptive:` looks for the best "
                "row itself: `rig copy adaptive` has an example"
            )
        assert refused.stderr == f"rig {command}: {reason}\n"
