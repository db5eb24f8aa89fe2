"""Counts that arrive late, in bursts or not at all create no false motion."""

from __future__ import annotations

import math
import random
import struct
from collections import deque
from collections.abc import Callable, Sequence

import pytest
from core_kinds import AXIS, DT

from controllers import estimator
from controllers.signals import AxisSense, Estimate
from drivers.canopen.bus_cycle import SYNC, BusCycle
from drivers.canopen.link import Frame
from drivers.canopen.torque_axis import TorqueAxis, TorqueAxisSettings
from drivers.cia402 import scaling, state_machine
from drivers.cia402.torque_drive import TorqueDriveSettings
from rig.design.estimator import design
from rig.realtime import axis
from rig.realtime.reasons import Reason
from rig.realtime.safety import RUN

SCALE = AXIS.metres_per_count
NODE = 5
DEADLINES = state_machine.Deadlines(0, *(2000 for _ in range(11)))
MACHINE = state_machine.Params(0.5, 1, 0, 0, 2, DEADLINES)
PEAK, OMEGA = 0.25, 2.0 * math.pi * 0.5  # m/s and rad/s of a body in a wave

Through = Callable[[int], int]  # number of pending statuses that arrive in a tick


class Bus:
    """A line with a drive that answers each SYNC; its answers may be delayed."""

    has_backlog = False

    def __init__(self) -> None:
        self.time = 100.0
        self.counts = 0
        self.through = 10**6
        self._held: deque[Frame] = deque()

    def now(self) -> float:
        return self.time

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        if (SYNC, b"") in frames:
            status = struct.pack("<Hhi", 0x1237, 0, self.counts)
            self._held.append(Frame(0x180 + NODE, status))
        return ()

    def drain(self) -> list[Frame]:
        return [self._held.popleft() for _ in range(min(self.through, len(self._held)))]

    def close(self) -> None:
        pass


def tracking_error(
    through: Through, ticks: int, own: axis.Params, blind: bool = False
) -> tuple[float, set[int]]:
    """Return the greatest velocity error (m/s) and all trip reasons after the filter settled.

    ``blind``: every count is taken as that of the last tick, as if its age were unknown.
    """
    bus = Bus()
    drive = TorqueAxis(
        TorqueAxisSettings(
            NODE, TorqueDriveSettings(MACHINE, scaling.CurrentScale(100.0, 0.01, 4000), 1.0)
        )
    )
    cycle = BusCycle(bus, [drive], 127, 1.0)
    state, worst, reasons = axis.start(), 0.0, set[int]()
    for tick in range(ticks):
        moment = tick * DT
        bus.through = through(tick)
        here = cycle.receive()
        reading = drive.read(here)
        age = DT if blind else min(reading.age, 1.0)
        sense = AxisSense(reading.counts, age, 0.0, 1, 0, DT)
        if tick > 0:  # no answer can arrive before
            motion = axis.observe(own, state, sense, 0.0, 1, DT)
            reason = axis.check(own, state, sense, motion, 0.0, RUN)
            state, _ = axis.control(own, state, sense, motion, axis.NO_DEMAND, 1, 0, RUN, DT)
            if tick > 2000:
                true = PEAK * math.cos(OMEGA * (moment - DT))
                worst = max(worst, abs(motion.velocity - true))
                reasons.add(reason)
        bus.counts = round(PEAK / OMEGA * math.sin(OMEGA * moment) / SCALE)
        cycle.send([drive.command(0.0, 0, here)])
        bus.time += DT
    return worst, reasons - {int(Reason.NONE)}


def limited(age: float) -> axis.Params:
    bounds = AXIS.limits._replace(encoder_age_stop=age, encoder_jump_stop=0.01, velocity_stop=1.0)
    return AXIS._replace(limits=bounds)


def stalled(start: int, length: int, pieces: int) -> Through:
    """No status for ``length`` ticks, then ``pieces`` statuses in each tick."""
    return lambda tick: 10**6 if tick < start else 0 if tick < start + length else pieces


NORMAL, _ = tracking_error(lambda tick: 10**6, 3200, limited(0.2))


@pytest.mark.parametrize(
    ("pieces", "max_delay"), [(10**6, 0.03), (33, 0.03), (17, 0.03), (5, 0.03), (2, 0.15)]
)
@pytest.mark.parametrize("start", [2500, 2750, 3000])
def test_a_host_stall_of_60_ms_creates_no_motion(start: int, pieces: int, max_delay: float) -> None:
    """The wave has an acceleration of 0.8 m/s2: extrapolated over 60 ms it errs by some mm/s.

    Two statuses a tick need another 60 ms to catch up, and the last ones are used ticks late.
    """
    worst, reasons = tracking_error(stalled(start, 60, pieces), start + 700, limited(0.2))
    assert reasons == set()
    assert worst < NORMAL + max_delay


def test_without_ages_the_same_counts_look_like_motion() -> None:
    """Counter-check of the test above: the same wire without ages."""
    worst, reasons = tracking_error(stalled(3000, 60, 5), 3700, limited(0.2), blind=True)
    assert worst > 1.0
    assert reasons & {int(Reason.VELOCITY), int(Reason.ENCODER_JUMP)}


@pytest.mark.parametrize("later", [2, 4])
def test_a_permanently_slower_wire_is_tracked(later: int) -> None:
    """Permanently late answers count for the SYNC before: a step of v times 4 ms."""
    worst, reasons = tracking_error(stalled(2500, later, 1), 4000, limited(0.02))
    assert reasons == set()
    assert worst < NORMAL + 0.06


@pytest.mark.parametrize("seed", range(4))
def test_repeated_host_stalls_create_no_motion(seed: int) -> None:
    """Ten seconds with random stalls of 5 to 60 ms and a wire that catches up slowly."""
    rng = random.Random(seed)
    through: list[int] = [10**6] * 2200
    while len(through) < 12_000:
        through += [0] * rng.randint(5, 60) + [rng.choice((3, 5))] * rng.randint(30, 200)
    worst, reasons = tracking_error(lambda tick: through[tick], 12_000, limited(0.2))
    assert reasons == set()
    assert worst < NORMAL + 0.15


def test_missing_counts_stop_the_rig() -> None:
    _, reasons = tracking_error(stalled(2500, 10**6, 0), 2600, limited(0.02))
    assert reasons == {int(Reason.STALE_ENCODER)}


@pytest.mark.parametrize("one_in", [50, 500])
def test_occasional_lost_statuses_are_tolerated(one_in: int) -> None:
    """A lost status is like a delayed one: the next status carries its counts."""
    worst, reasons = tracking_error(
        lambda tick: 0 if tick % one_in == 0 else 10**6, 4000, limited(0.02)
    )
    assert reasons == set()
    assert worst < NORMAL + 0.01


def test_the_minimum_age_is_remembered() -> None:
    state = axis.start()
    for age, min_age in ((0.06, 0.06), (0.001, 0.001), (0.002, 0.001), (0.0008, 0.0008)):
        sense = AxisSense(0, age, 0.0, 1, 0, 0.0)
        motion = axis.observe(AXIS, state, sense, 0.0, 1, DT)
        state, _ = axis.control(AXIS, state, sense, motion, axis.NO_DEMAND, 1, 0, RUN, DT)
        assert state.min_age == min_age
        assert state.encoder_age == age


FAST = design(1e-5, 0.0, 1e4, DT)  # a fine encoder: nearly dead-beat


def alternating(late: float) -> Callable[[int], float]:
    return lambda tick: late if tick % 2 else 0.0


def random_delays(late: float) -> Callable[[int], float]:
    rng = random.Random(7)
    return lambda tick: late * rng.random()


@pytest.mark.parametrize("gains", [AXIS.estimator, FAST], ids=["coarse", "fast"])
@pytest.mark.parametrize("late", [0.2 * DT, 0.5 * DT, 0.9 * DT, 0.005, 0.03, 0.3])
@pytest.mark.parametrize("pattern", [lambda late: lambda tick: late, alternating, random_delays])
def test_late_counts_never_make_the_filter_unstable(
    gains: estimator.Params, late: float, pattern: Callable[[float], Callable[[int], float]]
) -> None:
    """A filter with a wrong state converges on a body at rest, however late its counts are.

    A correction of the present estimate with an old difference diverges from half a tick on.
    """
    params = AXIS._replace(estimator=gains)
    state = axis.start()._replace(
        motion=Estimate(0.01, 0.2, 1.0), demand_source=RUN, encoder_age=0.0, min_age=0.0
    )
    delay = pattern(late)
    for tick in range(round((2.0 + 60.0 * late) / DT)):
        age = min(delay(tick), state.encoder_age + DT)  # no value is older than the one before
        sense = AxisSense(0, age, 0.0, 1, 0, 0.0)
        motion = axis.observe(params, state, sense, 0.0, 1, DT)
        state, _ = axis.control(params, state, sense, motion, axis.NO_DEMAND, 1, 0, RUN, DT)
    assert abs(state.motion.position) < 1e-5
    assert abs(state.motion.velocity) < 1e-3
