"""Opening of a campaign: its chain of files, all problems at once, CSV matrices, stability."""

import json
import time
from pathlib import Path
from typing import Any

import pytest

from rig.campaign import resolved_config
from rig.config.problems import ConfigError
from rig.kinds.wavebot.campaign import check_campaign, open_campaign
from rig.kinds.wavebot.campaign.kind import spring_map_problems
from rig.kinds.wavebot.campaign.stability import largest_ki, total_stiffness
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.tasks import examine

CONFIGS = Path(__file__).parents[2] / "configs"


def reported_problems(path: Path) -> list[tuple[str, int, str, str]]:
    with pytest.raises(ConfigError) as error_info:
        open_campaign(path)
    return [(Path(p.file).name, p.line, p.key, p.message) for p in error_info.value.problems]


@pytest.mark.parametrize(
    "path", sorted((CONFIGS / "campaigns").glob("*.yaml")), ids=lambda p: p.stem
)
def test_every_shipped_campaign_can_be_run(path: Path) -> None:
    """An adaptive one starts from its prediction, which takes a second."""
    report = examine(path) if path.stem == "adaptive" else check_campaign(path)
    assert report.ok, report.text()


@pytest.mark.parametrize("folder", ["rigs", "limits", "plants", "seas"])
def test_a_file_of_another_kind_gives_a_single_problem(folder: str) -> None:
    path = min((CONFIGS / folder).glob("*.yaml"))
    assert reported_problems(path) == [
        (path.name, 1, "", "not a campaign: it has none of the keys rig, sea, matrix")
    ]


def test_problems_of_all_files_are_reported_together(write: Any, tmp_path: Path) -> None:
    for file, old, new in (
        ("rigs/wavebot.yaml", "rate_hz: 1000", "rate_hz: 10"),
        ("limits/wavebot.yaml", "  current_rms_a: 20 ", "  current_rmsa: 20 "),
        ("plants/wavebot.yaml", "kind: stub", "kind: [stub"),
    ):
        path = tmp_path / file
        assert old in path.read_text()
        path.write_text(path.read_text().replace(old, new))
    problems = reported_problems(write("repeat: 0\norder: wrong\n"))
    assert [(file, key) for file, _, key, _ in problems] == [
        ("test.yaml", "repeat"),
        ("test.yaml", "order"),
        ("wavebot.yaml", "rate_hz"),
        ("wavebot.yaml", "heave.current_rms_a"),
        ("wavebot.yaml", "heave.current_rmsa"),
        ("wavebot.yaml", ""),
    ]
    assert "YAML syntax" in problems[-1][3]


def test_missing_files_are_reported_where_they_are_named(write: Any, tmp_path: Path) -> None:
    path = write()
    (tmp_path / "limits" / "wavebot.yaml").unlink()
    (tmp_path / "plants" / "wavebot.yaml").unlink()
    rig = (tmp_path / "rigs" / "wavebot.yaml").read_text().splitlines()
    limits, plant = reported_problems(path)
    assert limits[2] == "limits"
    assert rig[limits[1] - 1].startswith("limits:")
    assert plant[2] == "plant"
    assert rig[plant[1] - 1].startswith("plant:")
    assert "No such file" in plant[3]
    (tmp_path / "rigs" / "wavebot.yaml").unlink()
    assert [p[:3] for p in reported_problems(path)] == [("test.yaml", 2, "rig")]
    assert reported_problems(tmp_path / "none.yaml")[0][:2] == ("none.yaml", 1)


def test_the_campaign_may_name_another_plant(write: Any, tmp_path: Path) -> None:
    (tmp_path / "plants" / "other.yaml").write_text("extends: wavebot.yaml\nmass_kg: 1\n")
    (tmp_path / "rigs" / "wavebot.yaml").write_text(
        (tmp_path / "rigs" / "wavebot.yaml").read_text().replace("plants/wave", "plants/none")
    )
    campaign = open_campaign(write("plant: ../plants/other.yaml\n"))
    assert campaign.plant == {"kind": "stub", "mass_kg": 1}
    assert campaign.plant_locate(("kind",)).path.name == "wavebot.yaml"
    assert [(f.role, f.path.name) for f in campaign.files] == [
        ("campaign", "test.yaml"),
        ("rig", "wavebot.yaml"),
        ("limits", "wavebot.yaml"),
        ("plant", "other.yaml"),
        ("plant", "wavebot.yaml"),
    ]


def test_an_empty_plant_key_keeps_the_plant_of_the_rig(write: Any) -> None:
    assert open_campaign(write("plant:\n")).plant == {"kind": "stub"}
    assert [p[2] for p in reported_problems(write("plant: 5\n"))] == ["plant"]


def test_paths_of_an_extended_campaign_are_relative_to_its_own_file(
    write: Any, tmp_path: Path
) -> None:
    write("matrix: {csv: m.csv}\n")
    (tmp_path / "campaigns" / "m.csv").write_text(
        "spring_n_per_m,kp_n_s_per_m,ki_n_per_m\n0,-1000,0\n"
    )
    deeper = tmp_path / "campaigns" / "deep" / "er"
    deeper.mkdir(parents=True)
    (deeper / "top.yaml").write_text("extends: ../../test.yaml\nname: top\n")
    campaign = open_campaign(deeper / "top.yaml")
    assert campaign.file.name == "top"
    assert campaign.points[0].kp == -1000.0


def test_in_a_grid_ki_changes_fastest(write: Any) -> None:
    body = (
        "matrix: {grid: [{spring_n_per_m: [0, 100], kp_n_s_per_m: [-1, -2],"
        " ki_n_per_m: {from: 0.1, to: 0.3, step: 0.1}}]}\n"
    )
    points = open_campaign(write(body)).points
    assert [(p.spring_rate, p.kp, p.ki) for p in points] == [
        (s, kp, ki) for s in (0.0, 100.0) for kp in (-1.0, -2.0) for ki in (0.1, 0.2, 0.3)
    ]


def test_an_extended_campaign_may_change_the_form_of_its_matrix(write: Any, tmp_path: Path) -> None:
    write()
    top = tmp_path / "campaigns" / "top.yaml"
    grid = "grid: [{spring_n_per_m: 0, kp_n_s_per_m: -1, ki_n_per_m: 0}]"
    top.write_text(f"extends: test.yaml\nmatrix:\n  list:\n  {grid}\n")
    assert [p.kp for p in open_campaign(top).points] == [-1.0]
    top.write_text(f"extends: test.yaml\nmatrix:\n  {grid}\n")
    ((_, line, key, message),) = reported_problems(top)
    assert (line, key) == (2, "matrix")
    assert message == "grid and list given; allowed exactly one of grid, list, csv"


HEADER = "spring_n_per_m,kp_n_s_per_m,ki_n_per_m\n"


@pytest.mark.parametrize(
    ("text", "place", "key", "expected"),
    [
        ("", "m.csv:1", "", "no row; allowed a header"),
        (HEADER, "m.csv:1", "", "no row"),
        (HEADER + "0,-999,0\n0,-1,0\n", "m.csv:1", "", "no row"),
        ("kp,ki,spring\n", "m.csv:1", "", "'kp,ki,spring' is not the header; allowed spring_n_per"),
        ("# by hand\n\nkp;ki\n", "m.csv:3", "", "is not the header"),
        (HEADER + "0,-1\n", "m.csv:2", "", "2 cells; allowed 3"),
        (HEADER + "0,-1,0\n0, x,0\n", "m.csv:3:4", "kp_n_s_per_m",
         "'x' is not a number; allowed -20000 .. 0 N*s/m"),
        (HEADER + "0,-1,\n", "m.csv:2:6", "ki_n_per_m", "'' is not a number"),
        (HEADER + "0,-1,nan\n", "m.csv:2:6", "ki_n_per_m", "nan is not a finite number"),
        (HEADER + "0,1,0\n", "m.csv:2:3", "kp_n_s_per_m", "(F = Kp v on the body"),
        (HEADER + "0,-1,40000\n", "m.csv:2:6", "ki_n_per_m", "allowed -30000 .. 30000 N/m"),
        (HEADER + "60000,-1,0\n", "m.csv:2:1", "spring_n_per_m", "allowed -50000 .. 50000 N/m"),
        (HEADER + "9000,-1,0\n", "m.csv:2", "spring_n_per_m", "outside the rig's spring map"),
        (HEADER + "0,-1,25000\n", "m.csv:2", "ki_n_per_m", "Ki is allowed up to 21337 N/m"),
    ],
)  # fmt: skip
def test_bad_csv(
    write: Any, tmp_path: Path, text: str, place: str, key: str, expected: str
) -> None:
    (tmp_path / "campaigns" / "m.csv").write_text(text)
    with pytest.raises(ConfigError) as error_info:
        open_campaign(write("matrix: {csv: m.csv}\n"))
    (problem,) = error_info.value.problems
    assert f"{place}: {key + ': ' if key else ''}" in problem.text()
    assert expected in problem.message


def test_all_bad_cells_of_a_csv(write: Any, tmp_path: Path) -> None:
    (tmp_path / "campaigns" / "m.csv").write_text(HEADER + "a,b,c\n0,-1,0\n0,d,0\n0,-999,0\nx\n")
    assert [p[1:3] for p in reported_problems(write("matrix: {csv: m.csv}\n"))] == [
        (2, "spring_n_per_m"),
        (2, "kp_n_s_per_m"),
        (2, "ki_n_per_m"),
        (4, "kp_n_s_per_m"),
    ]


def test_the_end_mark_is_never_commanded(write: Any, tmp_path: Path) -> None:
    # written by a spreadsheet: byte order mark, CRLF, blanks
    text = "\ufeff" + HEADER + "0, -1000 ,0\n\n0,-1500,2e3\n0,-999.0,0\n0,-2000,0\n"
    (tmp_path / "campaigns" / "m.csv").write_text(text.replace("\n", "\r\n"), newline="")
    campaign = open_campaign(write("matrix: {csv: m.csv}\n"))
    assert [(p.kp, p.ki) for p in campaign.points] == [(-1000.0, 0.0), (-1500.0, 2000.0)]
    assert campaign.files[-1].role == "matrix"
    (warning,) = check_campaign(write("matrix: {csv: m.csv}\n")).warnings
    assert (Path(warning.file).name, warning.line) == ("m.csv", 6)
    assert warning.message == "rows after the end mark (Kp = -999): 1 (line 6), will not be run"
    ((_, line, key, message),) = reported_problems(write("matrix: {csv: gone.csv}\n"))
    assert (line, key) == (4, "matrix.csv")
    assert "No such file" in message


@pytest.mark.parametrize(
    ("rate", "ki"), [(490.9, 21_900), (-5715.0, 14_400), (-8508.0, 11_000), (-10013.0, 9_200)]
)
def test_largest_ki_at_each_spring_rate(write: Any, rate: float, ki: float) -> None:
    stability = open_campaign(write()).rig.stability
    assert largest_ki(stability, rate) == pytest.approx(ki, abs=50)
    assert total_stiffness(stability, rate, largest_ki(stability, rate)) == pytest.approx(3000)


def test_a_row_with_too_little_stiffness_is_reported(write: Any) -> None:
    body = """\
matrix:
  grid:
    - spring_n_per_m: -5715
      kp_n_s_per_m: [-1000, -2000]
      ki_n_per_m: [0, 14000, 15000]
"""
    ((_, line, key, message),) = reported_problems(write(body))
    assert (line, key) == (8, "matrix.grid[0].ki_n_per_m[2]")
    assert message.startswith(
        "point 2 (and 1 more like it) (spring -5715 N/m, Ki 15000 N/m) leaves 2405 N/m of "
        "stiffness, less than 3000; at this spring rate Ki is allowed up to 14405 N/m"
    )


def test_a_set_point_with_too_little_stiffness_is_reported(write: Any) -> None:
    body = """\
order: fewest spring moves
start:
  set_point: {kp_n_s_per_m: -2000, ki_n_per_m: 12000}
matrix:
  list:
    - {spring_n_per_m: -8508, kp_n_s_per_m: -2000, ki_n_per_m: 0}
    - {spring_n_per_m: 0, kp_n_s_per_m: -2000, ki_n_per_m: 0}
"""
    ((_, line, key, message),) = reported_problems(write(body))
    assert (line, key) == (6, "start.set_point.ki_n_per_m")
    assert "leaves 2017 N/m of stiffness at the first row's spring rate of -8508 N/m" in message
    assert message.endswith("allowed up to 11017 N/m")


@pytest.mark.parametrize(
    ("rate", "line", "key"),
    [
        ("8400", 6, "matrix.grid[0].spring_n_per_m"),
        ("[0,\n        8400]", 7, "matrix.grid[0].spring_n_per_m[1]"),
        ("{from: 8300, to: 8400, step: 100}", 6, "matrix.grid[0].spring_n_per_m"),
    ],
)
def test_spring_rates_outside_the_map_are_reported(
    write: Any, rate: str, line: int, key: str
) -> None:
    body = f"""\
matrix:
  grid:
    - spring_n_per_m: {rate}
      kp_n_s_per_m: [-1, -2]
      ki_n_per_m: [0, 1]
"""
    ((_, *location, message),) = reported_problems(write(body))
    assert location == [line, key]
    assert "spring rate 8400 is outside the rig's spring map; allowed -10013 .. 8340 N/m" in message


def test_entries_of_a_list_are_reported_at_their_own_keys(write: Any) -> None:
    body = """\
matrix:
  list:
    - spring_n_per_m: 8400
      kp_n_s_per_m: -1
      ki_n_per_m: 0
    - spring_n_per_m: -5715
      kp_n_s_per_m: -1
      ki_n_per_m: 15000
"""
    assert [problem[1:3] for problem in reported_problems(write(body))] == [
        (6, "matrix.list[0].spring_n_per_m"),
        (11, "matrix.list[1].ki_n_per_m"),
    ]
    campaign = open_campaign(write())
    assert spring_map_problems(campaign.points, campaign.rig.spring) == ()


def test_too_many_rows_are_refused(write: Any) -> None:
    grid = "{spring_n_per_m: 0, kp_n_s_per_m: {from: 0, to: -199, step: -1}, ki_n_per_m: [0, 1]}"
    ((_, line, key, message),) = reported_problems(
        write(f"repeat: 100\nmatrix: {{grid: [{grid}]}}\n")
    )
    assert (line, key, message) == (4, "repeat", "40000 rows; allowed at most 10000")


def test_a_grid_of_millions_is_refused_from_its_lengths(write: Any) -> None:
    many = "{from: 0, to: -1998, step: -2}"
    grid = f"{{spring_n_per_m: [0, 1, 2], kp_n_s_per_m: {many}, ki_n_per_m: {many}}}"
    started = time.perf_counter()
    ((_, line, key, message),) = reported_problems(write(f"matrix: {{grid: [{grid}]}}\n"))
    assert (line, key, message) == (4, "matrix", "3000000 rows; allowed at most 10000")
    assert time.perf_counter() - started < 2.0


def test_a_csv_with_too_many_rows_is_refused_at_the_first_excess_row(
    write: Any, tmp_path: Path
) -> None:
    (tmp_path / "campaigns" / "m.csv").write_text(HEADER + "0,-1,0\n" * 10_001)
    problems = reported_problems(write("matrix: {csv: m.csv}\n"))
    assert problems == [("m.csv", 10_002, "", "more than 10000 rows; allowed at most 10000")]


def test_windows_that_do_not_fit_are_reported_with_the_minimum_interval(write: Any) -> None:
    body = "timing:\n  settle_s: 10\n  interval_s: 11\n"
    assert [p[1:3] for p in reported_problems(write(body))] == [(6, "timing.interval_s")]
    assert "allowed interval_s at least 12 s" in reported_problems(write(body))[0][3]


def test_the_resolved_configuration_is_complete_and_can_be_read_again(write: Any) -> None:
    campaign = open_campaign(write("tare: none\ntiming: mask4\n"))
    text = resolved_config(campaign)
    config = json.loads(text)
    assert set(config) == {"campaign", "points", "rig", "limits", "plant", "law", "files"}
    assert config["campaign"]["start"]["lead_in_s"] == 120.0
    assert config["campaign"]["tare"] == "none"
    assert config["limits"]["heave"]["position_stop_m"] == 0.35
    assert config["plant"] == {"kind": "stub"}
    assert all(len(file["sha256"]) == 64 for file in config["files"])
    assert CampaignFile.model_validate(config["campaign"]) == campaign.file
    assert text == resolved_config(campaign)


def test_report(write: Any) -> None:
    good = check_campaign(write())
    assert good.ok
    assert "wave clock 140 s" in good.text()
    config = json.loads(good.to_json())
    assert config["ok"] is True
    assert config["rows"] == 1
    assert config["phases_s"] == {
        "tare": 5.0, "lead_in": 120.0, "moving": 0.5, "settle": 5.0, "measure": 14.0, "tail": 1.0,
    }  # fmt: skip
    bad = check_campaign(write("repeat: 0\n"))
    assert not bad.ok
    *_, problem, count, further = bad.text().splitlines()
    assert problem.endswith("repeat: 0 is out of range; allowed 1 .. 1000")
    assert count == "1 problem"
    assert further.startswith("more checks follow once this is corrected: ")
    assert json.loads(bad.to_json())["problems"][0]["key"] == "repeat"


def test_lines_after_the_end_mark_are_counted(write: Any, tmp_path: Path) -> None:
    """Lines after the end mark are counted even if they are invalid; they are not parsed."""
    path = tmp_path / "campaigns" / "m.csv"
    path.write_text(HEADER + "0,-1,0\n# end\n0,-999,0\n\n0,-2,0\nx\n# no row\n0,-999,0\n0,-3,0\n")
    (warning,) = check_campaign(write("matrix: {csv: m.csv}\n")).warnings
    assert "4 (lines 6-7, 9-10), will not be run" in warning.message
    path.write_text(HEADER + "0,-1,0\n0,-999,0\n\n# nothing after the mark\n")
    assert check_campaign(write("matrix: {csv: m.csv}\n")).warnings == ()
