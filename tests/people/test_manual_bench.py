"""Manual mode of the bench: jog, homing, signals, brake; limits, refusals, rows that are kept."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chance_set_points import ManualRig, manual_task, run_by_chance, with_pool
from rig_command import rig_here

from controllers import signal_generator
from controllers.signal_generator import CHIRP, SINE, STEP
from rig.cli.manual import write_task
from rig.config.problems import ConfigError
from rig.execution.attended import attended_task
from rig.kinds.oswec_bench import tasks
from rig.kinds.oswec_bench.tick import manual, speed
from rig.kinds.oswec_bench.tick.manual import ANGLE, TORQUE, VELOCITY
from rig.people.set_points import LiveColumns, LiveSet, RefusedError
from rig.realtime.safety import RUN

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
RIGS = {
    "velocity": ("rigs/oswec_bench.yaml", "velocity"),
    "torque": ("sessions/torque_closed_loop.yaml", ""),  # its shaft is clamped
    "torque, open": ("rigs/oswec_bench.yaml", "torque"),
    "flap": ("rigs/oswec_flap.yaml", "velocity"),
    "flap, torque": ("sessions/flap_pto_sweep.yaml", ""),
}


def drawn(live: LiveColumns, random_: random.Random, share: float = 0.4) -> LiveSet:
    """Return a set point with values in the allowed ranges, mostly modest, with one signal.

    ``share``: of the largest values and amplitudes, and of 6 Hz.
    """
    values, signal = dict(live.first().values), dict(live.first().signal)
    columns = {each["key"]: each for each in live.describe()}
    for key in values:
        ends = columns[key]["low"], columns[key]["high"]
        if random_.random() < 0.5:
            values[key] = min(1.0, 2.0 * share) * random_.random() ** 2 * random_.choice(ends)
    signal["kind"] = random_.choice(["none", "sine", "step", "chirp"])
    amplitude = random_.choice([key for key in signal if key.startswith("amplitude")])
    signal[amplitude] = share * columns[amplitude]["high"] * random_.random()
    signal["frequency_hz"] = 6.0 * share * random_.random()
    signal["end_frequency_hz"] = 6.0 * share * random_.random()
    return LiveSet(values, signal)


def gently(live: LiveColumns, random_: random.Random) -> LiveSet:
    """Return a set point at which the water does not overload the load cell of a flap."""
    return drawn(live, random_, 0.03)


@pytest.fixture(scope="module")
def open_rig(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], ManualRig]:
    rigs: dict[str, ManualRig] = {}

    def find(name: str) -> ManualRig:
        if name not in rigs:
            file, drive = RIGS[name]
            folder, clamped = tmp_path_factory.mktemp("bench"), drive == "torque"
            run = manual_task(CONFIGS / file, folder, drive, clamped=clamped)
            rigs[name] = with_pool(*run, gently if name == "flap" else drawn, name)
        return rigs[name]

    return find


def check_changes(rig: ManualRig, count: int, seed: int, spacing: int = 400) -> None:
    """Execute set points by chance; commands obey slew and limits, no value passes its stop."""
    rows, _ = run_by_chance(rig, count, seed, spacing)
    params: Any = rig.task.params.rig
    dt, limits = rig.task.dt, params.motor.limits
    assert np.abs(rows["command.velocity"]).max() <= params.speed.max_velocity
    step = np.abs(np.diff(rows["command.velocity"])).max()
    assert step <= params.speed.acceleration * dt * (1 + 1e-9)
    assert np.abs(rows["command.current"]).max() <= limits.current_peak
    step = np.abs(np.diff(rows["command.current"] * limits.newtons_per_ampere)).max()
    assert step <= limits.force_slew * dt * 1.1  # two constants, by direction
    assert np.abs(np.diff(rows["command.brake_current"])).max() <= params.brake.slew * dt * 1.001
    assert np.abs(rows["motor.angle"]).max() < limits.position_stop
    assert np.abs(rows["shaft.velocity"]).max() < limits.velocity_stop
    chosen = rows["reference.velocity"] if params.mode == 0 else rows["reference.torque"]
    assert np.abs(chosen).max() > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("name", RIGS)
def test_set_points_by_chance(name: str, open_rig: Callable[[str], ManualRig]) -> None:
    check_changes(open_rig(name), 120, 0)


# --- the law

DT = 0.001
PARAMS = manual.Params(ramp=0.5, end=0.5, homing_rate=2.0, homing_change=4.0, acceleration=200.0)
REST = manual.AT_REST._replace(speed=0.3)


def signal(kind: int, amplitude: float, frequency: float = 1.0) -> signal_generator.SetPoint:
    return signal_generator.SetPoint(float(kind), amplitude, frequency, 2.0, 10.0)


class Motor:
    """A motor that turns with the velocity that is demanded."""

    def __init__(self, angle: float = 0.0) -> None:
        self.state, self.angle = manual.start(), angle
        self.demands: list[manual.Demand] = []

    def follow(self, chosen: manual.SetPoint, seconds: float, damping: float = 0.0) -> Motor:
        for _ in range(round(seconds / DT)):
            self.state, demand = manual.step(PARAMS, self.state, chosen, damping, self.angle, DT)
            self.angle += demand.velocity * DT
            self.demands.append(demand)
        return self

    def velocities(self) -> np.ndarray[Any, Any]:
        return np.array([each.velocity for each in self.demands])


def test_a_jog_is_ramped_and_ends_before_the_range_does() -> None:
    motor = Motor().follow(REST._replace(velocity=0.4), 0.5)
    assert motor.velocities()[-1] == pytest.approx(0.4)
    assert np.abs(np.diff(motor.velocities())).max() == pytest.approx(0.4 / 0.5 * DT)
    assert motor.angle == pytest.approx(0.5 * 0.4 * 0.5, rel=0.01)
    motor.follow(REST._replace(velocity=0.4), 10.0)
    assert motor.angle == pytest.approx(PARAMS.end, abs=1e-6)
    assert motor.angle <= PARAMS.end


@pytest.mark.parametrize("acceleration", [1.0, 3.0, 10.0, 200.0])
@pytest.mark.parametrize("lag", [1e-4, 0.02, manual.LAG])
@pytest.mark.parametrize("by_signal", [False, True])
def test_a_fast_velocity_ends_there_with_a_drive_that_brakes_slowly_or_lags(
    acceleration: float, lag: float, by_signal: bool
) -> None:
    """As the bench does: the command obeys the limit of acceleration, and the motor lags."""
    params = PARAMS._replace(ramp=0.05, acceleration=acceleration)
    chosen = REST._replace(velocity=2.5)
    if by_signal:
        chosen = REST._replace(quantity=float(VELOCITY), signal=signal(STEP, 2.5))
    state, limiter = manual.start(), speed.start()
    limits = speed.Params(1.0, 10.0, 2.5, acceleration)
    angle, velocity, fastest = -0.45, 0.0, 0.0
    angles = []
    for _ in range(8000):
        state, demand = manual.step(params, state, chosen, 0.0, angle, DT)
        limiter, command = speed.limit_command(limits, limiter, demand.velocity, RUN, DT)
        velocity += (command.velocity - velocity) * (1.0 - math.exp(-DT / lag))
        fastest = max(fastest, velocity)
        angle += velocity * DT
        angles.append(angle)
    assert max(angles) <= params.end + math.radians(0.05)
    assert angle == pytest.approx(params.end, abs=1e-3)
    assert fastest > 0.6 * min(2.5, math.sqrt(acceleration * 0.5))


@pytest.mark.parametrize("start", [-0.3, 0.4, 0.7])
def test_the_motor_returns_to_its_goal_without_overshoot(start: float) -> None:
    """With at most its speed, at least from 3 time constants on within 5 % of the way."""
    motor = Motor(start).follow(REST._replace(angle=0.1), 0.4 / 0.3 + 3.0)
    assert np.abs(motor.velocities()).max() <= 0.3
    assert abs(motor.angle - 0.1) < 0.05 * abs(start - 0.1)
    assert (motor.angle - 0.1) * (start - 0.1) >= 0.0
    still = Motor(start if start < PARAMS.end else 0.4)
    still.follow(REST._replace(angle=0.1, speed=0.0), 1.0)
    assert not still.velocities().any()


def test_a_sine_of_the_angle_is_followed_about_the_goal() -> None:
    chosen = REST._replace(angle=0.1, quantity=float(ANGLE), signal=signal(SINE, 0.05))
    motor = Motor(0.1).follow(chosen, 3.0)
    times = np.arange(2000, 3000) * DT
    expected = 0.05 * 2.0 * np.pi * np.cos(2.0 * np.pi * times)
    assert motor.velocities()[2000:] == pytest.approx(expected, abs=2e-3)


def test_a_velocity_that_is_asked_ends_homing() -> None:
    chosen = REST._replace(quantity=float(VELOCITY), signal=signal(SINE, 0.2))
    motor = Motor(0.3).follow(REST, 0.3)
    assert motor.velocities()[-1] < -0.1
    motor.follow(chosen, 3.0)
    times = np.arange(2000, 3000) * DT
    assert motor.velocities()[2300:] == pytest.approx(0.2 * np.sin(2.0 * np.pi * times), abs=2e-3)
    motor.follow(REST, 6.0)
    assert motor.angle == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("ramp", [0.05, 0.5, 3.0])
@pytest.mark.parametrize("kind", [SINE, CHIRP])
def test_a_signal_on_the_velocity_swings_to_one_side(kind: int, ramp: float) -> None:
    """By twice its amplitude over the lowest angular frequency; with a fast ramp by most of it."""
    chosen = REST._replace(quantity=float(VELOCITY), signal=signal(kind, 0.2, 0.5))
    state, angle, angles = manual.start(), 0.0, []
    for _ in range(10_000):  # a whole sweep
        state, demand = manual.step(PARAMS._replace(ramp=ramp), state, chosen, 0.0, angle, DT)
        angle += demand.velocity * DT
        angles.append(angle)
    swing = 2.0 * 0.2 / (2.0 * math.pi * 0.5)
    assert np.abs(angles).max() <= 1.001 * swing
    assert ramp > 0.1 or max(angles) > 0.85 * swing


@pytest.mark.parametrize(("kind", "frequency"), [(STEP, 0.0), (SINE, 0.25), (SINE, 1.0)])
def test_the_ramp_of_an_amplitude_of_the_angle_adds_to_the_velocity(
    kind: int, frequency: float
) -> None:
    most = 0.1 * math.hypot(1.0 / PARAMS.ramp, 2.0 * math.pi * frequency)
    chosen = REST._replace(speed=0.0, quantity=float(ANGLE), signal=signal(kind, 0.1, frequency))
    fastest = np.abs(Motor().follow(chosen, 5.0).velocities()).max()
    assert fastest <= 1.001 * most
    assert kind == SINE or fastest == pytest.approx(most)


def test_a_signal_on_another_quantity_waits_for_zero() -> None:
    first = REST._replace(quantity=float(VELOCITY), signal=signal(STEP, 0.2))
    motor = Motor().follow(first, 1.0)
    second = REST._replace(quantity=float(ANGLE), signal=signal(CHIRP, 0.05))
    motor.follow(second, 0.49)
    assert motor.state.quantity == VELOCITY
    motor.follow(second, 0.1)
    assert motor.state.quantity == ANGLE
    # The signal's ramp, homing that begins at once, and the chirp at its highest frequency.
    most = max(0.2 / PARAMS.ramp, 4.0 * 0.3) * DT + 0.05 * (2.0 * np.pi * 2.0) ** 2 * DT
    assert np.abs(np.diff(motor.velocities())).max() <= most


def test_torque_and_damping_of_the_motor_are_ramped() -> None:
    chosen = REST._replace(torque=20.0, quantity=float(TORQUE), signal=signal(STEP, 10.0))
    motor = Motor().follow(chosen, 1.0, damping=50.0)
    torque = np.array([each.torque for each in motor.demands])
    damping = np.array([each.damping for each in motor.demands])
    assert torque[-1] == pytest.approx(30.0)
    assert np.abs(np.diff(torque)).max() == pytest.approx(30.0 / 0.5 * DT)
    assert (damping[-1], np.diff(damping).max()) == pytest.approx((50.0, 50.0 / 0.5 * DT))
    assert manual.excites(motor.state)
    assert not manual.excites(Motor().follow(REST, 1.0, damping=50.0).state)


# --- checks, and rows that are kept


@pytest.fixture
def live(tmp_path: Path) -> Callable[[str], Any]:
    def find(name: str) -> Any:
        file, drive = RIGS[name]
        return manual_task(CONFIGS / file, tmp_path, drive)[0].people.live

    return find


SINE_5 = {"kind": "sine", "amplitude_deg": 5.0}
SWING_10 = {
    "kind": "sine",
    "amplitude_rad_per_s": math.radians(5.0) * 2.0 * math.pi,
    "frequency_hz": 1.0,
}
STEP_1 = {"kind": "step", "amplitude_rad_per_s": 1.0}


@pytest.mark.parametrize(
    ("name", "values", "given", "parts"),
    [
        ("velocity", {"explode": 1.0}, {}, ("explode: no such column; known are angle_deg",)),
        ("velocity", {"torque_n_m": 1.0}, {}, ("torque_n_m: no such column",)),
        ("velocity", {"angle_deg": float("nan")}, {}, ("allowed -26 .. 26 deg",)),
        ("velocity", {"angle_deg": True}, {}, ("angle_deg: True; allowed",)),
        ("velocity", {"angle_deg": 26.1}, {}, ("angle_deg: 26.1; allowed -26 .. 26 deg",)),
        ("velocity", {"velocity_rad_per_s": -2.6}, {}, ("allowed -2.5 .. 2.5 rad/s",)),
        ("velocity", {"speed_rad_per_s": -0.1}, {}, ("allowed 0 .. 2.5 rad/s",)),
        ("velocity", {"brake_current_a": 1.1}, {}, ("brake_current_a: 1.1; allowed 0 .. 1 A",)),
        ("velocity", {"damping_n_m_s_per_rad": 1001}, {}, ("allowed 0 .. 1000",)),
        ("velocity", {}, {"kind": "square"}, ("allowed none, sine, step, chirp",)),
        ("velocity", {}, {"amplitude_n_m": 1.0}, ("signal.amplitude_n_m: no such key",)),
        ("velocity", {}, {"amplitude_deg": -1.0}, ("signal.amplitude_deg: -1.0; allowed 0 .. 26",)),
        ("velocity", {"angle_deg": -24.0}, SINE_5, ("together 29; allowed up to 26 deg",)),
        ("velocity", {"velocity_rad_per_s": 0.1}, SINE_5, ("allowed 0 with a signal on the",)),
        ("velocity", {}, SINE_5 | {"amplitude_rad_per_s": 1.0}, ("allowed one of them above 0",)),
        ("velocity", {}, SINE_5 | {"frequency_hz": 5.0}, ("turn with 3.04711", "up to 2.5 rad/s")),
        ("velocity", {"speed_rad_per_s": 2.0}, SINE_5 | {"frequency_hz": 1.0}, ("with 2.575",)),
        ("velocity", {"velocity_rad_per_s": -2.0}, STEP_1, ("turn with 3 rad/s",)),
        ("velocity", {}, STEP_1 | {"kind": "sine", "frequency_hz": 50.0}, ("314.159 rad/s^2",)),
        ("velocity", {}, STEP_1 | {"kind": "sine", "frequency_hz": 0.1}, ("by 182.4 deg",)),
        ("velocity", {"angle_deg": -16.1}, SWING_10, ("angle_deg, signal.amplitude_rad_per_s",
         "by 10 deg to one side; allowed up to 26 deg")),
        ("velocity", {}, SWING_10 | {"kind": "chirp", "frequency_hz": 2, "end_frequency_hz": 0.38},
         ("by 26.32 deg",)),
        ("velocity", {"speed_rad_per_s": 2.0}, {"kind": "step", "amplitude_deg": 20.0},
         ("turn with 2.69813 rad/s; allowed up to 2.5",)),
        ("velocity", {}, STEP_1 | {"kind": "chirp", "end_frequency_hz": 0.0}, ("without end",)),
        ("torque", {"torque_n_m": 121.0}, {}, ("allowed -120 .. 120 N*m",)),
        ("torque", {"torque_n_m": -120.0}, {}, ("together 120; allowed below 120 N*m",)),
        ("torque", {"torque_n_m": -60.0}, {"kind": "sine", "amplitude_n_m": 61.0}, ("121",)),
        ("torque", {"angle_deg": 1.0}, {}, ("angle_deg: no such column",)),
        ("torque", {"pto_damping_n_m_s_per_rad": 1.0}, {}, ("no such column",)),
        ("flap", {"brake_current_a": 0.1}, {}, ("brake_current_a: no such column",)),
        ("flap, torque", {"pto_damping_n_m_s_per_rad": 1001.0}, {}, ("allowed 0 .. 1000",)),
        ("velocity", {"angle_deg": 27.0, "x": 1.0}, {"kind": 1}, ("angle_deg", "x: no", "kind: 1")),
    ],
)  # fmt: skip
def test_set_points_outside_the_limits_are_refused(
    name: str,
    values: dict[str, Any],
    given: dict[str, Any],
    parts: tuple[str, ...],
    live: Callable[[str], Any],
) -> None:
    found = live(name)
    first = found.first()
    checked = found.check(LiveSet(first.values | values, first.signal | given))
    assert not checked.numbers
    for each in parts:
        assert each in "; ".join(checked.problems)


@pytest.mark.parametrize(
    ("name", "values", "given", "parts"),
    [
        ("velocity", {}, {}, ("signal.kind: none; a row is a sine",)),
        ("velocity", {"angle_deg": 5.0}, SINE_5, ("angle_deg: 5; a row moves around zero",)),
        ("velocity", {}, {"kind": "sine", "amplitude_rad_per_s": 0.5, "frequency_hz": 1.0},
         ("signal.amplitude_deg: 0; a row needs it",)),
        ("velocity", {}, SINE_5 | {"frequency_hz": 0.0}, ("signal.frequency_hz: 0",)),
        ("velocity", {}, SINE_5 | {"amplitude_deg": 0.01}, ("rows[0].amplitude_deg", "0.1 .. 90")),
        ("velocity", {}, SINE_5 | {"frequency_hz": 6.0, "amplitude_deg": 1.0},
         ("rows[0].period_s", "0.2 .. 600 s")),
        ("torque", {"torque_n_m": 5.0}, {"kind": "step", "amplitude_n_m": 5.0},
         ("torque_n_m: 5; a row moves around zero", "signal.kind: step")),
        ("torque", {"damping_n_m_s_per_rad": 5.0}, {"kind": "sine", "amplitude_n_m": 5.0},
         ("a row of a session torque_tracking has no such column",)),
        ("flap, torque", {}, {}, ("a row of a session flap_pto_sweep has waves",)),
    ],
)  # fmt: skip
def test_set_points_that_are_no_row_are_not_kept(
    name: str,
    values: dict[str, Any],
    given: dict[str, Any],
    parts: tuple[str, ...],
    live: Callable[[str], Any],
    tmp_path: Path,
) -> None:
    found = live(name)
    first = found.first()
    chosen = LiveSet(first.values | values, first.signal | given)
    assert not found.check(chosen).problems
    with pytest.raises(RefusedError) as refused:
        found.keep(chosen, "")
    for each in parts:
        assert each in str(refused.value)
    assert not (tmp_path / "kept.yaml").exists()
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize(
    ("session", "amplitude", "row"),
    [
        ("irregular", "amplitude_deg", {"amplitude_deg": 5, "period_s": 2}),
        ("driveline_online", "amplitude_deg", {"amplitude_deg": 5, "period_s": 2}),
        ("brake_map", "amplitude_deg", {"amplitude_deg": 5, "period_s": 2, "brake_current_a": 0}),
        ("velocity_constant", "amplitude_deg", {"amplitude_deg": 5, "period_s": 2}),
        ("flap_hydrostatic", "amplitude_deg", {"amplitude_deg": 5, "period_s": 2}),
        ("torque_constant", "amplitude_n_m", {"current_amplitude_a": 5 / 16.845, "period_s": 2}),
        ("torque_closed_loop", "amplitude_n_m", {"torque_amplitude_n_m": 5, "period_s": 2}),
    ],
)
def test_kept_rows_extend_the_session(
    session: str, amplitude: str, row: dict[str, float], tmp_path: Path
) -> None:
    """A kept file passes the check; its rows have the values that were set."""
    file = CONFIGS / "sessions" / f"{session}.yaml"
    found = manual_task(file, tmp_path)[0].people.live
    assert found is not None
    first = found.first()
    chosen = LiveSet(first.values, first.signal | {"kind": "sine", amplitude: 5.0})
    for text in ("one", "two"):
        path, left_out = found.keep(chosen, text)
        assert left_out == ""  # a row of a session has its sine
    report = tasks.examine(Path(path))
    assert report.plan is not None, report.text()
    assert report.checked is not None
    assert report.checked.file.session == tasks.examine(file).checked.file.session  # type: ignore[union-attr]
    kept = [each.values for each in report.plan.rows]
    assert len(kept) == 2
    assert {key: kept[1][key] for key in row} == pytest.approx(row)
    assert not sum(value for key, value in kept[1].items() if key not in row)


def within_session(name: str, tmp_path: Path) -> Any:
    path = CONFIGS / "sessions" / f"{name}.yaml"
    report = tasks.examine(path)
    assert report.checked is not None
    assert report.plan is not None
    task = tasks.execution_task(report.checked, report.plan)
    return attended_task(
        task, report.checked, report.plan, path, tasks.examine, tmp_path / "kept.yaml"
    ).people


def test_the_set_point_of_a_row(tmp_path: Path) -> None:
    """A sine is the generator's; an irregular motion and waves are left out."""
    chosen = within_session("driveline", tmp_path).live.of_row(13)
    assert chosen.values["damping_n_m_s_per_rad"] == 62.5
    assert (chosen.signal["kind"], chosen.signal["amplitude_deg"]) == ("sine", 20.0)
    assert chosen.signal["frequency_hz"] == pytest.approx(1.0 / 1.5)
    chosen = within_session("torque_constant", tmp_path).live.of_row(0)
    assert chosen.signal["amplitude_n_m"] == pytest.approx(1.12 * 16.845)
    chosen = within_session("irregular", tmp_path).live.of_row(0)
    assert (chosen.signal["kind"], chosen.values["damping_n_m_s_per_rad"]) == ("none", 83.3)
    chosen = within_session("flap_pto_sweep", tmp_path).live.of_row(2)
    assert chosen.values == {"torque_n_m": 0.0, "pto_damping_n_m_s_per_rad": 50.0}
    assert chosen.signal["kind"] == "none"


def test_a_row_beyond_the_range_of_manual_mode_stands_still(tmp_path: Path) -> None:
    path = tmp_path / "wide.yaml"
    text = (CONFIGS / "sessions" / "driveline_short.yaml").read_text()
    text = text.replace("../rigs/", f"{CONFIGS}/rigs/").replace("[5, 15]", "[5, 30]")
    path.write_text(text)
    found = manual_task(path, tmp_path)[0].people.live
    assert found is not None
    report = tasks.examine(path)
    assert report.checked is not None
    assert report.plan is not None
    task = tasks.execution_task(report.checked, report.plan)
    people = attended_task(
        task, report.checked, report.plan, path, tasks.examine, tmp_path / "kept.yaml"
    ).people
    assert people.live is not None
    assert people.live.of_row(0).signal["kind"] == "sine"
    assert people.live.of_row(3).signal["kind"] == "none"


@pytest.mark.parametrize("name", ["flap_rao", "flap_free_decay"])
def test_a_flap_free_of_its_motor_has_no_set_points(name: str, tmp_path: Path) -> None:
    people = within_session(name, tmp_path)
    assert people.live is None
    assert "free of the motor" in people.no_live


def test_the_torque_loop_needs_a_clamped_shaft(tmp_path: Path) -> None:
    """The damping of a stop, which would act then, swings a free motor up."""
    path = tmp_path / "free.yaml"
    base = CONFIGS / "sessions" / "torque_open_loop.yaml"
    path.write_text(f"extends: {base}\nshaft: free\n")
    (problem,) = tasks.examine(path).problems
    assert problem.key == "shaft"
    with pytest.raises(ConfigError, match="shaft: free: in the torque loop"):
        write_task(path, tmp_path, clamped=True)
    bench = CONFIGS / "rigs" / "oswec_bench.yaml"
    with pytest.raises(ConfigError, match=r"a free shaft .* say so with --clamped"):
        write_task(bench, tmp_path, "torque")
    assert "shaft: clamped" in write_task(bench, tmp_path, "torque", clamped=True).read_text()
    assert write_task(CONFIGS / "sessions" / "torque_open_loop.yaml", tmp_path).exists()


@pytest.mark.parametrize(
    ("file", "options", "parts"),
    [
        ("rigs/oswec_flap_free.yaml", (), ("oswec_flap_free.yaml", "free of the motor")),
        ("sessions/flap_rao.yaml", (), ("flap_rao.yaml:4: session: flap_rao", "free of the motor")),
        ("rigs/oswec_bench.yaml", ("--drive", "torque"), ("a free shaft", "say so with --clamped")),
        ("rigs/oswec_bench.yaml", ("--clamped",), ("driveline moves the shaft", "leave --clamped")),
        ("sessions/flap_pto_sweep.yaml", ("--clamped",), ("moves the shaft", "leave --clamped")),
        ("rigs/wavebot.yaml", ("--clamped",), ("no shaft to clamp",)),
        ("sessions/driveline.yaml", ("--drive", "torque"), ("uses the velocity loop",)),
    ],
)
def test_what_cannot_be_moved_by_hand_is_refused(
    file: str, options: tuple[str, ...], parts: tuple[str, ...], tmp_path: Path
) -> None:
    code, _, errors = rig_here("manual", CONFIGS / file, *options, "--runs", tmp_path)
    assert code == 2
    for each in parts:
        assert each in errors
