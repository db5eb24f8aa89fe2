"""Open-loop replay: what a run sensed, through today's cycle, against what was decided then.

The cycle is pure, so with the same senses it must give the same commands and modes to the last bit;
where it does not, code or configuration are not what they were. What a command would have done to
the body is not asked: the senses stay those of the log.

Requests of people are not logged. Where the log's safety machine went somewhere that only a request
leads to, that request is given to the cycle, too, and told.
"""

import os
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from rig.kinds import oswec_bench
from rig.kinds.wavebot import KIND, Sense
from rig.kinds.wavebot.build import wavebot_params
from rig.planning.campaign import Plan, build_plan
from rig.planning.campaign.recorded import RecordedCampaign, campaign_from_record
from rig.planning.session.assemble import bench_params
from rig.planning.session.plan import plan_session
from rig.planning.session.recorded import session_as_logged
from rig.realtime import cycle, safety
from rig.recording import row_layout
from rig.recording.runs import RunError, reader, run_info
from rig.recording.runs.folder import RunInfo
from rig.recording.runs.mcap_file import Records, row_dtype

_LOGGED_AS = {  # words of a WaveBot's `Sense` by their place in a row; others stand by their name
    "heave": "heave.sense",
    "surge": "surge.sense",
    "spring": "spring_sense",
    "power": "power_sense",
    "drive": "drive_sense",
}
_GIVEN = ("tick", "time", "timing", "tick_end")
_TIMING = ("timing.lateness", "timing.work", "timing.skipped")
_SAFETY = ("safety.mode", "safety.reason")
_REQUESTS = {
    "STOP": safety.REQUEST_STOP,
    "ABORT": safety.REQUEST_ABORT,
    "HOLD": safety.REQUEST_HOLD,
    "RESUME": safety.REQUEST_RESUME,
    "LOGGER_LOST": safety.REQUEST_LOGGER_LOST,
    "SUPERVISOR_LOST": safety.REQUEST_SUPERVISOR_LOST,
}
Seen = Callable[[int], None]


class _Subject(NamedTuple):
    """What is replayed: a kind of rig, told what the run was told."""

    kind: cycle.Kind
    sense: Any  # type of what is read in a tick
    places: dict[str, str]  # of its words in a row
    params: cycle.Params
    dt: float  # s

    def fields(self) -> list[str]:
        """The row's fields that make up a sense, in its order."""
        found = []
        for leaf in row_layout.leaves(self.sense):
            word, *rest = leaf.path
            found.append(".".join([self.places[word], *rest]))
        return found

    def given(self, name: str) -> bool:
        """Whether a field of the row is what the cycle is given, not what it makes of it."""
        words = tuple(f"{each}." for each in (*_GIVEN, *self.places.values()))
        return name in _GIVEN or name.startswith(words)


class Difference(NamedTuple):
    """A field that did not come out as it was logged."""

    field: str
    unit: str
    ticks: int  # in which it differs
    first: int  # tick
    logged: float  # in that tick
    replayed: float
    largest: float  # difference; NaN where one of the two is no number


class Request(NamedTuple):
    """A request that the log shows."""

    tick: int
    name: str


class Replayed(NamedTuple):
    """A run beside its replay."""

    run: str
    ticks: int
    fields: int  # compared
    differences: tuple[Difference, ...]  # the earliest first; empty: no difference
    requests: tuple[Request, ...]
    absent: tuple[str, ...]  # fields of today's rows that the run does not have
    finished: bool  # its logger ended the record; else what it lost at the end is not compared

    @property
    def same(self) -> bool:
        """Whether nothing differs."""
        return not self.differences


def replay(run: str | os.PathLike[str], see: Seen = lambda ticks: None) -> Replayed:
    """Every tick of a run through today's cycle; ``see`` is told how many ticks are done.

    Raises RunError for a run that cannot be replayed: no configuration of today's, no tick, or no
    record of its first tick, ticks lost from the log, or a sense that was not logged.
    """
    source = reader.open_files(run)
    known = run_info(run, source.contents)
    subject = _subject(known)
    names = [leaf.name for leaf in source.leaves]
    absent_senses = [name for name in (*subject.fields(), *_TIMING, *_SAFETY) if name not in names]
    if absent_senses:
        raise RunError(f"{known.run}: it did not log {', '.join(absent_senses)}")
    today = row_layout.leaves(subject.kind.row_type)
    compared = [leaf for leaf in today if leaf.name in names and not subject.given(leaf.name)]
    tally, walk = _Tally(compared), _Walk(subject, known.run)
    done = 0
    for block in reader.blocks(source):
        tally.add(block, walk.through(block))
        done += len(block)
        see(done)
    if not done:
        raise RunError(f"{known.run}: it logged no tick")
    absent = tuple(leaf.name for leaf in today if leaf.name not in names)
    finished = all(contents.finished for contents in source.contents)
    found, requests = tally.differences(), tuple(walk.requests)
    return Replayed(known.run, done, len(compared), found, requests, absent, finished)


class _Walk:
    """The cycle, block after block of logged ticks."""

    def __init__(self, subject: _Subject, run: str) -> None:
        self._params, self._dt, self._run = subject.params, subject.dt, run
        self._step = cycle.make(subject.kind)
        self._state = cycle.start(subject.kind, subject.params, 0)
        self._fields = subject.fields()
        self._sense = subject.sense
        kinds: list[Any] = list(subject.sense.__annotations__.values())
        self._words = [(kind, len(kind._fields)) for kind in kinds]
        self._pack = row_layout.packer(subject.kind.row_type)
        self._dtype = row_dtype(row_layout.leaves(subject.kind.row_type))
        self._next = self._skipped = 0
        self.requests: list[Request] = []

    def through(self, block: Records) -> Records:
        """The rows that today's cycle makes of these ticks."""
        size = self._dtype.itemsize
        packed = bytearray(size * len(block))
        for i, (tick, timing, sense, told) in enumerate(self._given(block)):
            skipped = timing.skipped - self._skipped
            if tick != self._next + skipped:
                raise RunError(
                    f"{self._run}: tick {self._next} is not in the log, so what came after it "
                    "cannot be replayed"
                )
            self._next, self._skipped = tick + 1, timing.skipped
            self._pack(packed, i * size, self._tick(tick, timing, sense, told, 1 + skipped))
        return np.frombuffer(packed, self._dtype)

    def _tick(
        self, tick: int, timing: cycle.Timing, sense: Any, told: tuple[int, int], periods: int
    ) -> Any:
        """One row; where the log's mode or reason needs a request, with that request."""

        def stepped(request: int) -> tuple[cycle.State, Any]:
            state, _, row = self._step(
                self._params, self._state, sense, request, tick, timing, periods, self._dt
            )
            return state, row

        state, row = stepped(safety.REQUEST_NONE)
        if (row.safety.mode, row.safety.reason) != told:
            for name, request in _REQUESTS.items():
                asked, asked_row = stepped(request)
                if (asked_row.safety.mode, asked_row.safety.reason) == told:
                    self.requests.append(Request(tick, name))
                    state, row = asked, asked_row
                    break
        self._state = state
        return row

    def _given(self, block: Records) -> Iterator[tuple[int, cycle.Timing, Any, tuple[int, int]]]:
        """Tick, timing, sense, and mode and reason of the log."""
        columns = [block[name].tolist() for name in self._fields]
        ticks = block["tick"].tolist()
        timings = zip(*(block[name].tolist() for name in _TIMING), strict=True)
        told = zip(*(block[name].tolist() for name in _SAFETY), strict=True)
        for tick, timing, safe, values in zip(
            ticks, timings, told, zip(*columns, strict=True), strict=True
        ):
            words, at = [], 0
            for kind, length in self._words:
                words.append(kind(*values[at : at + length]))
                at += length
            yield tick, cycle.Timing(*timing), self._sense(*words), safe


class _Tally:
    """What differs, field by field, as blocks come."""

    def __init__(self, compared: list[row_layout.Leaf]) -> None:
        self._leaves = compared
        self._found: dict[str, Difference] = {}

    def add(self, logged: Records, replayed: Records) -> None:
        """Compare some more ticks; numbers that are none are alike."""
        for leaf in self._leaves:
            one, other = logged[leaf.name], replayed[leaf.name]
            differs = (one != other) & ~(np.isnan(one) & np.isnan(other))
            at = np.flatnonzero(differs)
            if len(at) == 0:
                continue
            size = float(np.abs(one[at].astype(float) - other[at]).max())
            i = at[0]
            first = Difference(
                leaf.name,
                leaf.unit,
                0,
                int(logged["tick"][i]),
                float(one[i]),
                float(other[i]),
                size,
            )
            before = self._found.get(leaf.name, first)
            largest = float(np.maximum(before.largest, size))
            self._found[leaf.name] = before._replace(ticks=before.ticks + len(at), largest=largest)

    def differences(self) -> tuple[Difference, ...]:
        """All of them, the earliest first, in the order of the row where they begin together."""
        return tuple(sorted(self._found.values(), key=lambda found: found.first))


def as_logged(known: RunInfo) -> RecordedCampaign:
    """What a run was configured to do; RunError where its record has none that holds today."""
    try:
        return campaign_from_record(known.config)
    except KeyError as error:
        raise RunError(f"{known.run}: its record holds no configuration ({error})") from None
    except ValueError as error:
        raise _not_of_today(known, error) from None


def _subject(known: RunInfo) -> _Subject:
    """Rig and parameters, made by today's code of the configuration in the run."""
    try:
        return _bench(known) if "session" in known.config else _wavebot(known)
    except KeyError as error:
        raise RunError(f"{known.run}: its record holds no configuration ({error})") from None
    except ValueError as error:
        raise _not_of_today(known, error) from None


def _wavebot(known: RunInfo) -> _Subject:
    campaign, rig, limits, points, record = as_logged(known)
    planned: Plan = build_plan(campaign, rig, points)
    params = wavebot_params(campaign, rig, limits, planned.segments, planned.setpoints, record)
    places = {word: _LOGGED_AS.get(word, word) for word in Sense._fields}
    return _Subject(KIND, Sense, places, params, planned.dt)


def _bench(known: RunInfo) -> _Subject:
    session = session_as_logged(known.config)
    planned = plan_session(session)
    places = {word: word for word in oswec_bench.Sense._fields}
    return _Subject(
        oswec_bench.KIND, oswec_bench.Sense, places, bench_params(session, planned), planned.dt
    )


def _not_of_today(known: RunInfo, error: ValueError) -> RunError:
    return RunError(f"{known.run}: its configuration does not hold today: {error}")
