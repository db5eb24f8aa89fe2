"""The contents of a row table: as recorded in a plan, and of runs whose plans list a part."""

import json

import pytest

from controllers import impedance, nonlinear_damping
from rig.kinds.wavebot.row_contents import row_contents
from rig.recording.runs.folder import earlier_contents
from rig.row_contents import LAW, RowContents, columns_from_records, from_records

WAVEBOT = row_contents(impedance.COLUMNS)


@pytest.mark.parametrize("contents", [WAVEBOT, row_contents(nonlinear_damping.COLUMNS)])
def test_a_plan_gives_the_contents_back(contents: RowContents) -> None:
    assert from_records(json.loads(json.dumps(contents.as_records()))) == contents


def test_earlier_runs_have_the_contents_of_a_wavebot() -> None:
    assert earlier_contents() == WAVEBOT._replace(signals={})  # they have no budget
    assert from_records({}, WAVEBOT) == WAVEBOT


def test_columns_without_roles_are_known_ones_or_those_of_a_law() -> None:
    listed = [
        {"key": "spring_n_per_m", "name": "spring_rate", "unit": "N/m", "label": "spring rate"},
        {"key": "coulomb_n", "name": "coulomb", "unit": "N", "label": "Coulomb force"},
    ]
    spring, coulomb = columns_from_records(listed, WAVEBOT.columns)
    assert spring == WAVEBOT.columns[0]
    assert (coulomb.role, coulomb.unit, coulomb.tolerance) == (LAW, "N", 0.0)
