"""Short rehearsals of each kind of rig at the slowest and fastest rates, compared with 1 kHz."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from modular_rigs import limits_mapping, plant_mapping, rig_mapping
from modular_rigs import write_campaign as write_modular_campaign
from rehearsing import CONFIGS, SilentView, write_campaign, write_yaml
from rig_command import rig_here

from rig.execution.task import run_task
from rig.kinds.modular import tasks as modular
from rig.kinds.oswec_bench import tasks as bench
from rig.kinds.wavebot import tasks as wavebot
from rig.realtime.sequence import Phase
from rig.recording.runs import open_run

SEA = {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5}
TIMES = {
    "tare": {"duration_s": 1},
    "start": {"lead_in_s": 8},
    "timing": {"settle_s": 2, "interval_s": 6},
}
# Readings and commands are one tick old each, and a command lasts one tick, so results shift with
# the tick: by up to 0.6 % of the largest power or amplitude for each ms, as measured.
TOLERANCE_PER_MS = 0.006


class Case(NamedTuple):
    """A task of a kind of rig, and fields whose means and amplitudes are compared."""

    tasks: Any
    write: Callable[[Path, int], Path]
    powers: tuple[str, ...]
    position: str
    rates: tuple[int, ...]


def wavebot_task(folder: Path, rate: int) -> Path:
    rig = {"extends": str(CONFIGS / "rigs" / "wavebot.yaml"), "rate_hz": rate}
    points = [
        {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": ki} for ki in (0, 4000)
    ]
    return write_campaign(
        folder, rig=str(write_yaml(folder / "rig.yaml", rig)), sea=SEA, matrix={"list": points},
        **TIMES,
    )  # fmt: skip


def modular_task(folder: Path, rate: int) -> Path:
    points = [{"kp_n_s_per_m": kp, "ki_n_per_m": 0} for kp in (-2000, -1000)]
    rig = rig_mapping(rate_hz=rate)
    return write_modular_campaign(
        folder, rig, limits_mapping(), plant_mapping(), sea=SEA, matrix={"list": points}, **TIMES
    )


def flap_task(folder: Path, rate: int) -> Path:
    """The motor as a damper of the flap, fast enough to cross the coupling's gap in 2 ms."""
    rig = {"extends": str(CONFIGS / "rigs" / "oswec_flap.yaml"), "rate_hz": rate}
    return write_yaml(
        folder / "session.yaml",
        {
            "name": "test",
            "session": "flap_pto_sweep",
            "rig": str(write_yaml(folder / "rig.yaml", rig)),
            "grid": [
                {"wave_amplitude_m": 0.05, "period_s": 1.5, "pto_damping_n_m_s_per_rad": [35, 70]}
            ],
            "timing": {"rise_s": 6, "settle_periods": 0, "periods": 4},
        },
    )


CASES = {
    "wavebot": Case(
        wavebot,
        wavebot_task,
        ("power.mechanical_1", "power.mechanical_2", "power.ac", "power.dc"),
        "heave.estimate.position",
        (200, 500, 2000, 5000),
    ),
    "modular": Case(
        modular,
        modular_task,
        ("power.mechanical",),
        "heave.estimate.position",
        (200, 500, 2000, 5000),
    ),
    "flap": Case(
        bench, flap_task, ("power.load_cell", "power.motor"), "shaft.angle", (500, 2000, 5000)
    ),
}


class RowResult(NamedTuple):
    """Results of the measured windows of a run, one entry a row."""

    powers: np.ndarray  # W, by station and row
    amplitudes: np.ndarray  # of the position, by row


def rehearse(case: Case, folder: Path, rate: int) -> RowResult:
    report = case.tasks.examine(case.write(folder, rate), predict=False)
    assert report.ok, report.text()
    task = case.tasks.execution_task(report.checked, report.plan)
    mode = case.tasks.rehearsal_mode(report.checked, real_clock=False)
    result = run_task(task, folder / "runs", SilentView(), mode)
    assert result.outcome.status == "complete", result.outcome
    assert (result.outcome.skipped, result.outcome.dropped) == (0, 0)
    fields = ["plan.row", "plan.phase", *case.powers, case.position]
    run = open_run(result.folder, fields=fields)
    measured = run["plan.phase"].values == int(Phase.MEASURE)
    rows = [measured & (run["plan.row"].values == row) for row in range(2)]
    powers = [[run[name].values[row].mean() for row in rows] for name in case.powers]
    amplitudes = [run[case.position].values[row].std() for row in rows]
    assert all(row.sum() >= 4 * rate for row in rows)
    return RowResult(np.array(powers), np.array(amplitudes))


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], RowResult]:
    """Return the results of a kind at 1 kHz, measured once."""
    found: dict[str, RowResult] = {}

    def result(name: str) -> RowResult:
        if name not in found:
            found[name] = rehearse(CASES[name], tmp_path_factory.mktemp(name), 1000)
        return found[name]

    return result


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize(
    ("name", "rate"), [(name, rate) for name, case in CASES.items() for rate in case.rates]
)
def test_results_do_not_depend_on_the_rate(
    name: str, rate: int, reference: Callable[[str], RowResult], tmp_path: Path
) -> None:
    found, expected = rehearse(CASES[name], tmp_path, rate), reference(name)
    tolerance = TOLERANCE_PER_MS * max(1.0, 1e3 / rate - 1.0)
    scale = np.abs(expected.powers).max()
    assert scale > 1.0
    np.testing.assert_allclose(found.powers, expected.powers, rtol=0.0, atol=tolerance * scale)
    np.testing.assert_allclose(found.amplitudes, expected.amplitudes, rtol=tolerance)


@pytest.mark.parametrize(
    ("name", "rate", "message"),
    [
        ("wavebot", 199, "199 is out of range; allowed 200 .. 5000 Hz"),
        ("wavebot", 5001, "5001 is out of range; allowed 200 .. 5000 Hz"),
        ("modular", 300, "300 gives a tick that is not a whole number of ns; allowed 200, 250,"),
        ("flap", 400, "400 is out of range; allowed 500 .. 5000 Hz"),
    ],
)
def test_other_rates_are_refused_at_their_key(
    name: str, rate: int, message: str, tmp_path: Path
) -> None:
    case = CASES[name]
    report = case.tasks.examine(case.write(tmp_path, rate), predict=False)
    problem = next(one for one in report.problems if one.key == "rate_hz")
    assert Path(problem.file).name == "rig.yaml"
    assert problem.line > 0
    assert message in problem.message


def test_a_drive_that_expects_commands_at_another_rate_is_refused(tmp_path: Path) -> None:
    """0x60C2 is the time in which the drive moves to the command of a tick."""
    rig = {"extends": str(CONFIGS / "rigs" / "wavebot_hil.yaml"), "rate_hz": 500}
    path = write_campaign(
        tmp_path, rig=str(write_yaml(tmp_path / "rig.yaml", rig)), sea=SEA, **TIMES,
        matrix={"list": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}]},
    )  # fmt: skip
    problems = {one.key: one for one in wavebot.examine(path, predict=False).problems}
    assert set(problems) == {
        f"wiring.{axis}.objects.interpolation_time" for axis in ("heave", "surge")
    }
    heave = problems["wiring.heave.objects.interpolation_time"]
    assert heave.message == (
        "1 x 10^-3 s lasts 0.5 ticks at rate_hz = 500; allowed only one tick, 0.002 s"
    )
    assert Path(heave.file).name == "wavebot_hil.yaml"


def test_a_rate_that_overloads_the_can_bus_is_refused_by_check(tmp_path: Path) -> None:
    one_tick = {"objects": {"interpolation_time": 5, "interpolation_exponent": -4}}
    rig = {
        "extends": str(CONFIGS / "rigs" / "wavebot_hil.yaml"),
        "rate_hz": 2000,
        "wiring": {"heave": one_tick, "surge": one_tick},
    }
    path = write_campaign(
        tmp_path, rig=str(write_yaml(tmp_path / "rig.yaml", rig)), sea=SEA, **TIMES,
        matrix={"list": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}]},
    )  # fmt: skip
    code, report, message = rig_here("check", path)
    assert code == 2
    assert "1 (1 point x 1)" in report  # the predicted rows are shown all the same
    assert "WaveBot on wires at rate_hz = 2000: CAN bus at 1000 kbit/s: 1" in message
    assert "above 80 %" in message
    code, text, _ = rig_here("check", path, "--json")
    document = json.loads(text)
    assert (code, document["ok"], document["rows"]) == (2, False, 1)
    assert "above 80 %" in document["message"]
    assert "heave status: 135 bits" in message
