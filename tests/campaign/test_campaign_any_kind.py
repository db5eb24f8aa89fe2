"""A campaign of a rig that is no WaveBot: two axes with a law each, no part that moves."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from rig.campaign import CampaignKind, build_plan, check_campaign, open_campaign, resolved_config
from rig.campaign.law_checks import law_problems
from rig.campaign.record import campaign_from_record, law_notice, law_source, plan_record
from rig.campaign.set_points import columns_of
from rig.config.campaign_file import BaseCampaignFile, RowOrder, with_laws
from rig.config.law_settings import AxisLaw, find_law
from rig.config.matrix import KindColumns
from rig.config.model import FileModel
from rig.config.problems import ConfigError
from rig.config.rig_file import BaseRigFile
from rig.laws import Law
from rig.planning.input_files import ConfigSource
from rig.realtime.sequence import WAIT_DRIVE, Phase
from rig.row_contents import RowContents

COLUMNS = KindColumns(first=None, others=(), types={}, law_details={})
AXES = ("front", "back")
RIG = """\
name: two floats
kind: two floats
rate_hz: 100
realtime: best effort
limits: limits.yaml
plant: plant.yaml
drive_enable_timeout_s: 5
"""
CAMPAIGN = """\
name: pair
rig: rig.yaml
sea: {kind: calm}
start: {lead_in_s: 3}
law: {back: {use: nonlinear damping, smoothing_m_per_s: 0.02}}
reference: {kind: sine, frequency_hz: 0.5, amplitude_n: 20}
matrix:
  list:
    - front_kp_n_s_per_m: -100
      front_ki_n_per_m: 0
      back_quadratic_n_s2_per_m2: 30
      back_coulomb_n: 0
    - front_kp_n_s_per_m: -200
      front_ki_n_per_m: 5
      back_quadratic_n_s2_per_m2: 60
      back_coulomb_n: 2
repeat: 2
"""


class Limits(FileModel):
    position_m: float


class CampaignFile(BaseCampaignFile):
    order: RowOrder = "as given"


class Table(NamedTuple):
    columns: dict[str, Any]


def find_laws(campaign: ConfigSource, rig: ConfigSource | None) -> dict[str, Law]:
    given = campaign.mapping.get("law") or {}
    return {
        axis: find_law(given.get(axis), campaign.locate, COLUMNS, ("law", axis)) for axis in AXES
    }


def model(laws: dict[str, Law], rig: dict[str, Any]) -> type[CampaignFile]:
    return with_laws(
        CampaignFile,
        COLUMNS,
        tuple(
            (
                axis,
                AxisLaw(
                    law,
                    tuple(
                        column._replace(key=f"{axis}_{column.key}", name=f"{axis}_{column.name}")
                        for column in law.columns
                    ),
                    law.parameters,
                ),
            )
            for axis, law in laws.items()
        ),
    )


CAMPAIGNS = CampaignKind(
    rig_file=BaseRigFile,
    limits_file=Limits,
    campaign_file=CampaignFile,
    axes=lambda rig: AXES,
    find_laws=find_laws,
    model=model,
    gain_ramp=lambda rig, axis: 0.5,
    set_points=lambda file, rig, settings: Table(columns_of(settings)),
)


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    (tmp_path / "rig.yaml").write_text(RIG)
    (tmp_path / "limits.yaml").write_text("position_m: 1\n")
    (tmp_path / "plant.yaml").write_text("mass: 3\n")
    path = tmp_path / "pair.yaml"
    path.write_text(CAMPAIGN)
    return path


def test_the_plan_waits_for_the_drive_and_moves_nothing(campaign: Path) -> None:
    opened = open_campaign(CAMPAIGNS, campaign)
    plan = build_plan(opened)
    assert [row.point for row in plan.rows] == [0, 1, 0, 1]
    assert plan.rows[1].setting._asdict() == {
        "front_kp": -200.0, "front_ki": 5.0, "front_km": 0.0,
        "back_quadratic": 60.0, "back_coulomb": 2.0,
    }  # fmt: skip
    assert plan.moves == 0
    moving = plan.segments.phase.index(Phase.MOVING)
    assert plan.segments.phase.count(Phase.MOVING) == 1
    assert (plan.segments.wait[moving], plan.segments.timeout[moving]) == (WAIT_DRIVE, 500)
    assert plan.phases.lead_in == 3.0
    assert plan.setpoints.columns["front_kp"] == (-100.0, -200.0)
    assert opened.file.law_settings("back").smoothing_m_per_s == 0.02
    assert opened.file.law_settings("front").zc is None
    assert opened.file.reference.axis == "front"


def test_the_report_names_the_laws_by_axis(campaign: Path) -> None:
    report = check_campaign(CAMPAIGNS, campaign)
    text = report.text()
    assert "rows      4 (2 points x 2), as given\n" in text
    assert "plus waiting for the drive" in text
    assert "law       back: nonlinear damping (" in text
    assert "spring" not in report.to_json()


def test_a_recorded_campaign_gives_the_same_plan(campaign: Path) -> None:
    opened = open_campaign(CAMPAIGNS, campaign)
    config = json.loads(resolved_config(opened))
    read_back = campaign_from_record(CAMPAIGNS, config, law_source(opened).encode())
    assert read_back.file.model_dump() == opened.file.model_dump()
    assert build_plan(read_back).rows == build_plan(opened).rows
    assert build_plan(read_back).segments == build_plan(opened).segments
    assert law_notice(CAMPAIGNS, config) == ""
    contents = RowContents("front", (), opened.file.columns(), ())
    row = plan_record(opened, build_plan(opened), contents)["rows"][0]
    assert (row["front_kp"], row["back_coulomb"]) == (-100.0, 0.0)
    assert "stator" not in row


def test_laws_given_by_files_are_recorded_by_axis(campaign: Path, tmp_path: Path) -> None:
    source = Path("controllers/nonlinear_damping.py").read_bytes()
    (tmp_path / "own.py").write_bytes(source)
    campaign.write_text(CAMPAIGN.replace("use: nonlinear damping", "use: own.py"))
    opened = open_campaign(CAMPAIGNS, campaign)
    text = law_source(opened)
    assert json.loads(text) == {"back": source.decode()}
    assert [file.role for file in opened.files if file.role == "law"] == ["law"]
    read_back = campaign_from_record(CAMPAIGNS, json.loads(resolved_config(opened)), text.encode())
    assert build_plan(read_back).rows == build_plan(opened).rows


@pytest.mark.parametrize(
    ("old", "new", "key", "message"),
    [
        ("use: nonlinear damping", "use: none such", "law.back.use", "no law 'none such'"),
        ("smoothing_m_per_s: 0.02", "smoothing_m_per_s: 9", "law.back.smoothing_m_per_s", "range"),
        ("amplitude_n: 20", "amplitude_n: 20, axis: left", "reference.axis", "allowed front, back"),
        ("front_kp_n_s_per_m: -100\n      ", "", "matrix.list[0].front_kp_n_s_per_m", "missing"),
        ("repeat: 2", "order: fewest spring moves", "order", "allowed as given, random"),
        ("repeat: 2", "surge: {use: hold}", "surge", "unknown key"),
    ],
)
def test_problems_have_the_keys_of_the_axes(
    campaign: Path, old: str, new: str, key: str, message: str
) -> None:
    campaign.write_text(CAMPAIGN.replace(old, new, 1))
    with pytest.raises(ConfigError) as caught:
        open_campaign(CAMPAIGNS, campaign)
    assert [problem.key for problem in caught.value.problems] == [key]
    assert message in caught.value.problems[0].message


def test_a_law_that_refuses_its_settings_is_a_problem_of_its_axis(campaign: Path) -> None:
    campaign.write_text(
        CAMPAIGN.replace("law: {", "law: {front: {zc: {numerator: [1, 0], denominator: [1]}}, ")
    )
    with pytest.raises(ConfigError) as caught:
        open_campaign(
            CAMPAIGNS, campaign, lambda parts: law_problems(parts, {"front": 0.5, "back": 0.5})
        )
    assert [problem.key for problem in caught.value.problems] == ["law.front.zc"]
