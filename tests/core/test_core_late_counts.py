"""Counts that come late, in heaps or not at all: no motion is made of them that was not there."""

from __future__ import annotations

import math
import random
import struct
from collections import deque
from collections.abc import Callable

import pytest
from core_kinds import AXIS, DT

from controllers import estimator
from controllers.signals import AxisSense, Estimate
from drivers.canopen import cia402, scaling
from drivers.canopen.bus_cycle import SYNC, BusCycle
from drivers.canopen.link import Frame
from drivers.canopen.torque_axis import Settings, TorqueAxis
from rig.realtime import axis
from rig.realtime.safety import RUN, Reason

SCALE = AXIS.metres_per_count
NODE = 5
DEADLINES = cia402.Deadlines(0, *(2000 for _ in range(11)))
MACHINE = cia402.Params(0.5, 1, 0, 0, 2, DEADLINES)
PEAK, OMEGA = 0.25, 2.0 * math.pi * 0.5  # m/s and rad/s of a body in a wave

Through = Callable[[int], int]  # how many of the statuses under way arrive in a tick


class Bus:
    """A line with a drive at its end that answers each SYNC; its answers may be held up."""

    behind = False

    def __init__(self) -> None:
        self.time = 100.0
        self.counts = 0
        self.through = 10**6
        self._held: deque[Frame] = deque()

    def now(self) -> float:
        return self.time

    def send(self, cob_id: int, data: bytes) -> bool:
        if cob_id == SYNC:
            status = struct.pack("<Hhi", 0x1237, 0, self.counts)
            self._held.append(Frame(0x180 + NODE, status))
        return True

    def drain(self) -> list[Frame]:
        return [self._held.popleft() for _ in range(min(self.through, len(self._held)))]

    def close(self) -> None:
        pass


def followed(
    through: Through, ticks: int, own: axis.Params, blind: bool = False
) -> tuple[float, set[int]]:
    """Greatest error of the velocity (m/s) and all reasons to trip, once the filter has settled.

    ``blind``: every count is taken for one of the last tick, as if its age were not known.
    """
    bus = Bus()
    drive = TorqueAxis(Settings(NODE, MACHINE, scaling.CurrentScale(100.0, 0.01, 4000), 1.0))
    cycle = BusCycle(bus, [drive], 127, 1.0)
    state, worst, reasons = axis.start(), 0.0, set[int]()
    for tick in range(ticks):
        moment = tick * DT
        bus.through = through(tick)
        here = cycle.receive()
        reading = drive.read(here)
        age = DT if blind else min(reading.age, 1.0)
        sense = AxisSense(reading.counts, age, 0.0, 1, 0, DT)
        if tick > 0:  # before, nothing can have come
            motion = axis.observe(own, state, sense, 0.0, 1, DT)
            reason = axis.check(own, state, sense, motion, 0.0, RUN)
            state, _ = axis.control(own, state, sense, motion, axis.NOTHING, 1, 0, RUN, DT)
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
    """Nothing for so many ticks, then so many statuses in each."""
    return lambda tick: 10**6 if tick < start else 0 if tick < start + length else pieces


NORMAL, _ = followed(lambda tick: 10**6, 3200, limited(0.2))


@pytest.mark.parametrize(
    ("pieces", "most"), [(10**6, 0.03), (33, 0.03), (17, 0.03), (5, 0.03), (2, 0.15)]
)
@pytest.mark.parametrize("start", [2500, 2750, 3000])
def test_a_host_that_stands_still_for_60_ms_makes_no_motion(
    start: int, pieces: int, most: float
) -> None:
    """The wave has an acceleration of 0.8 m/s2: carried on for 60 ms it is off by some mm/s.

    Two at a time take as long again to catch up, and the last ones are used some ticks late.
    """
    worst, reasons = followed(stalled(start, 60, pieces), start + 700, limited(0.2))
    assert reasons == set()
    assert worst < NORMAL + most


def test_without_their_age_the_same_counts_are_a_surge() -> None:
    """What the test above is about can be seen: the same wire, and ages that nobody counted."""
    worst, reasons = followed(stalled(3000, 60, 5), 3700, limited(0.2), blind=True)
    assert worst > 1.0
    assert reasons & {int(Reason.VELOCITY), int(Reason.ENCODER_JUMP)}


@pytest.mark.parametrize("later", [2, 4])
def test_a_wire_that_became_a_little_slower_for_good_is_followed(later: int) -> None:
    """Answers that never catch up are counted as of the SYNC before: a step of v times 4 ms."""
    worst, reasons = followed(stalled(2500, later, 1), 4000, limited(0.02))
    assert reasons == set()
    assert worst < NORMAL + 0.06


@pytest.mark.parametrize("seed", range(4))
def test_a_host_that_loses_a_quarter_of_its_time_makes_no_motion(seed: int) -> None:
    """Stalls of 5 to 60 ms at any time, and a wire that catches up slowly: for ten seconds."""
    rng = random.Random(seed)
    through: list[int] = [10**6] * 2200
    while len(through) < 12_000:
        through += [0] * rng.randint(5, 60) + [rng.choice((3, 5))] * rng.randint(30, 200)
    worst, reasons = followed(lambda tick: through[tick], 12_000, limited(0.2))
    assert reasons == set()
    assert worst < NORMAL + 0.15


def test_nothing_at_all_stops_the_rig() -> None:
    _, reasons = followed(stalled(2500, 10**6, 0), 2600, limited(0.02))
    assert reasons == {int(Reason.STALE_ENCODER)}


@pytest.mark.parametrize("one_in", [50, 500])
def test_a_wire_that_loses_a_status_now_and_then_is_followed(one_in: int) -> None:
    """As one that holds it back for a tick: it comes with the next one."""
    worst, reasons = followed(lambda tick: 0 if tick % one_in == 0 else 10**6, 4000, limited(0.02))
    assert reasons == set()
    assert worst < NORMAL + 0.01


def test_the_usual_age_is_the_least() -> None:
    state = axis.start()
    for age, usual in ((0.06, 0.06), (0.001, 0.001), (0.002, 0.001), (0.0008, 0.0008)):
        sense = AxisSense(0, age, 0.0, 1, 0, 0.0)
        motion = axis.observe(AXIS, state, sense, 0.0, 1, DT)
        state, _ = axis.control(AXIS, state, sense, motion, axis.NOTHING, 1, 0, RUN, DT)
        assert state.min_age == usual
        assert state.age == age


def test_a_constant_delay_never_swings_up() -> None:
    """A filter put off the truth comes back to it, however late its measurements are.

    Without a slower filter the first of these delays is the limit, and the others diverge.
    """
    for late in (0.005, 0.01, 0.03, 0.1, 0.3):
        motion = Estimate(0.01, 0.2, 1.0)
        for _ in range(round(60 * (late + 0.05) / DT)):
            motion = estimator.step_late(AXIS.estimator, motion, 0.0, late, 1, DT)
        assert abs(motion.position) < 1e-3
        assert abs(motion.velocity) < 1e-3
