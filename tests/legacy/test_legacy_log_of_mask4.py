"""The real log of the MASK4 test: counts, irregularities, and runs that were read by hand."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import pytest
from log_books import MASK4_LOG
from measured_data import needs, reference

from rig.interop.legacy.testlog import Entry, RunLog, find_links, read_log
from rig.interop.legacy.testlog.entry import (
    Activity,
    Amplitude,
    Condition,
    Gain,
    RemarkKind,
    Spring,
    Wave,
    WaveKind,
)
from rig.interop.legacy.testlog.settings import SEAS

pytestmark = needs(MASK4_LOG)
K = RemarkKind


@pytest.fixture(scope="module")
def log() -> RunLog:
    return read_log(reference(MASK4_LOG))


def runs_with(log: RunLog, kind: RemarkKind) -> list[int]:
    return [e.run for e in log.entries if any(remark.kind is kind for remark in e.remarks)]


def runs(log: RunLog, condition: Callable[[Entry], Any]) -> list[int]:
    return [entry.run for entry in log.entries if condition(entry)]


def test_there_are_142_runs_and_four_rows_between_them(log: RunLog) -> None:
    assert [entry.run for entry in log.entries] == list(range(1, 143))
    assert {entry.series_name for entry in log.entries} == {"MASK4"}
    assert [(s.row, s.before_run) for s in log.separators] == [
        (9, 8), (53, 51), (91, 88), (111, 107),
    ]  # fmt: skip
    assert "Knew = 0.7690*Kold" in log.separators[1].text
    assert "CUSTOM DRIVE" in log.separators[3].text


def test_rates_before_run_51_are_those_of_the_old_map(log: RunLog) -> None:
    written = {e.run: e.spring.written_n_per_m for e in log.entries if e.spring}
    assert {run: rate for run, rate in written.items() if run < 51} == {
        21: 10000, 22: -12000, 23: -12000, 24: -12000, 25: -10000, 26: -6000, 29: 5000, 30: 5000,
        31: 10000, 32: 10000, 33: 10000, 35: -12000, 42: -8000, 46: -10000, 47: -12000,
    }  # fmt: skip
    assert {run: rate for run, rate in written.items() if run > 50} == {
        62: -6152, 66: -9228, 70: -7690, 72: -9228, 73: -9228, 74: -9228, 78: 0, 82: -6152,
        83: -6152, 84: 0, 85: 0, 86: 4164, 102: 0, 106: -2307, 107: -2307, 108: -2307,
        124: -7620, 126: -7620, 128: -9223, 141: -3000,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (K.RUN_ID_SPACES, [11]),
        (K.FILE_MISSING, [65, 72]),
        (K.FILE_PARTIAL, [3, 4, 23, 91]),
        (K.FILE_NO_NAME, [51, 52, 53, 54]),
        (K.FILE_SHARED, [14, 15]),
        (K.FILE_ORDER, [58]),
        (K.SERIES_MISSING, [28, 72]),
        (K.SERIES_SEVERAL, [35]),
        (K.SERIES_UNREADABLE, []),
        (K.NO_WATER, [1, 2, 3, 4, 5, 6, 7]),
        (K.HEIGHT_DISAGREES, []),
        (K.WAVES_UNREADABLE, [27]),
        (K.WAVES_MIXED, [141]),
        (K.SEA_NOT_IN_TABLE, [136]),
        (K.WAVE_UNCALIBRATED, [83]),
        (K.RANGE_EMPTY, [35]),
        (K.AMPLITUDE_UNKNOWN, [22]),
        (K.SPRING_UNSPECIFIED, [54, 55, 130, 131, 142]),
        (K.SPRING_SEVERAL, []),
        (K.SPRING_IN_NOTES, [124, 126]),
        (K.SPRING_CLOSE, [70, 124, 126, 128]),
        (K.DRIVE_CARRIED, [141, 142]),
        (K.SCHEME_IN_NOTES, [139]),
        (K.SCHEME_MISSPELT, [135, 136]),
        (K.SCHEME_SEVERAL, [120, 129]),
        (K.SCHEME_UNSPECIFIED, [134]),
        (K.SURGE_MISSPELT, [111, 116]),
        (K.BIAS, [16, 55, 56, 57, 81, 91, 93, 132]),
        (K.TIME_SYNC, [69, 70, 71, 72, 73, 109, 110, 125, 142]),
        (K.WAVE_MAKER, [28, 30, 40, 46, 65, 72, 84, 91, 109, 110, 113]),
        (K.SUPPLY, [134, 135, 136, 137]),
        (K.TRIPPED, [15, 17, 23, 84]),
        (K.ROWS_DOUBTFUL, [84, 124, 125]),
        (K.COLOUR_UNKNOWN, [106]),
    ],
)
def test_each_trap_is_found_where_it_is_and_nowhere_else(
    log: RunLog, kind: RemarkKind, expected: list[int]
) -> None:
    assert runs_with(log, kind) == expected


def test_remarks_quote_the_cell_they_name(log: RunLog) -> None:
    for entry in log.entries:
        for remark in entry.remarks:
            assert remark.cell[1:] == str(entry.row)
    (remark,) = [r for r in log.find(84).remarks if r.kind is K.ROWS_DOUBTFUL]
    assert (remark.cell, "rows after 11" in remark.text) == ("F87", True)


def test_regular_waves_have_amplitudes_and_irregular_ones_hs(log: RunLog) -> None:
    waves = [wave for entry in log.entries for wave in entry.waves]
    for wave in waves:
        assert (wave.amplitude_m is not None) == (wave.kind is WaveKind.REGULAR)
        assert (wave.hs_m is not None) == (wave.kind is WaveKind.JONSWAP)
    regular = [wave for wave in waves if wave.kind is WaveKind.REGULAR]
    assert {wave.amplitude_m for wave in regular} == {0.0635, 0.127, 0.254}
    assert {wave.frequency_hz for wave in regular} == {0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65}


def test_the_codes_of_irregular_waves_are_the_seas_of_the_reports_table(log: RunLog) -> None:
    """MASK4 report (Sandia), Table 3-1: one code per sea; the 3.5 s of run 136 are a remark."""
    table = {"8A": SEAS[0], "4A": SEAS[1], "6A": SEAS[2], "2A": SEAS[3], "23A": SEAS[4]}
    seen = set()
    for entry in log.entries:
        for wave in entry.waves:
            if wave.kind is WaveKind.JONSWAP and entry.run != 136:
                hs, tp = table[wave.code]
                assert wave.hs_m == hs
                assert wave.period_s == pytest.approx(tp, rel=1e-3)
                assert wave.gamma == 3.3
                seen.add(wave.code)
    assert seen == set(table)


def test_switching_schemes_are_those_of_the_reports_table(log: RunLog) -> None:
    """MASK4 report (Sandia), Table 3-2; the log has two more: ramps in 107, SineTri in 129."""
    runs_by_key = {name: runs(log, lambda e, n=name: e.scheme == n) for name in ("SVPWM", "DPWM")}
    assert runs_by_key["SVPWM"] == [
        107, 109, 111, 112, 113, 116, 117, 118, 119, 120, 124, 125, 126, 132, 133, 135, 136, 138,
        139,
    ]  # fmt: skip
    assert runs_by_key["DPWM"] == [110, 122, 127, 137]
    assert runs(log, lambda e: e.scheme == "SineTri") == [121, 129]
    assert runs(log, lambda e: e.scheme == "Hyst") == [123]


def test_the_custom_drive_is_in_from_107_to_139(log: RunLog) -> None:
    assert runs(log, lambda e: e.drive == "custom") == list(range(107, 140))
    assert {e.drive_source for e in log.entries if 107 < e.run < 139} == {"C111"}
    assert log.find(140).drive_source == "F145"
    assert runs(log, lambda e: e.surge == "disabled") == [
        107, 109, 110, 111, 116, 117, 118, 119, 139,
    ]  # fmt: skip
    assert runs(log, lambda e: e.surge == "enabled") == [140, 141]


def test_links(log: RunLog) -> None:
    found = find_links(log)
    assert found.shared_files == {"waveBotCtrlMdl_2023_09_21_04_46_26": (14, 15)}
    assert [found.wave_series[n] for n in (8, 13, 14, 15, 104)] == [
        (31,),
        (35,),
        (35,),
        (35,),
        (141,),
    ]
    assert found.unnamed_series == (11, 25, 29, 31, 32, 44, 47, 54, 61, 73, 79, 88, 94)
    assert all(len(used) == 1 for used in found.wave_series.values())
    repeats = {repeat.matrix: (repeat.runs, repeat.differences) for repeat in found.repeats}
    assert repeats["GainMatrix026"] == ((120, 121, 122, 123), ("scheme",))
    assert repeats["GainMatrix028"] == ((139, 140), ("drive", "scheme", "surge"))
    assert repeats["GainMatrix002"] == ((36, 37, 38), ("waves",))
    assert repeats["GainMatrix014"] == ((72, 73), ())  # 72 was cut short
    assert len(repeats) == 13
    assert sum(len(used) for used in found.matrices.values()) == 74
    assert len(found.matrices) == 50


def test_the_position_was_zeroed_seven_times_and_lost_once(log: RunLog) -> None:
    assert [(run, bias.action, bias.when) for run, bias in find_links(log).biases] == [
        (16, "lost", ""), (55, "corrected", "after"), (56, "attempted", ""),
        (57, "corrected", ""), (81, "corrected", "after"), (91, "seen", ""),
        (93, "corrected", "before"), (132, "zeroed", "before"),
    ]  # fmt: skip


def test_the_colours_of_the_rows(log: RunLog) -> None:
    runs_by_key = {c: runs(log, lambda e, c=c: e.condition is c) for c in Condition}
    assert runs_by_key[Condition.SERIOUS] == [
        15,
        22,
        23,
        84,
        91,
        124,
    ]  # two encodings of one colour
    assert runs_by_key[Condition.COMPROMISED] == [17, 19, 28, 97]
    assert runs_by_key[Condition.VERY_UNUSUAL] == [141]
    assert runs_by_key[Condition.UNUSUAL] == [81, 93, 108, 113, 135, 138, 139]
    assert runs_by_key[Condition.UNKNOWN] == [106]
    assert len(runs_by_key[Condition.WAVES_END_EARLY]) == 14
    assert len(runs_by_key[Condition.NOT_UPLOADED]) == 18


def test_files_are_in_order_but_for_one_pair(log: RunLog) -> None:
    times = [entry.recorded for entry in log.entries if entry.recorded]
    assert len(times) == 132
    falls = [pair for pair in itertools.pairwise(times) if pair[1] < pair[0]]
    assert falls == [("2023-09-26T07:14:18", "2023-09-26T07:13:35")]


def regular(amplitude: float, frequency: float) -> Wave:
    period = 1 / frequency
    return Wave(WaveKind.REGULAR, amplitude, None, frequency, period, "Hz")


def jonswap(hs: float, tp: float, written: str, repeat: float | None, code: str) -> Wave:
    return Wave(WaveKind.JONSWAP, None, hs, 1 / tp, tp, written, 3.3, repeat, code)


CALM = Wave(WaveKind.CALM)
BY_HAND: dict[int, dict[str, Any]] = {
    5: {"waves": (CALM,), "activities": (Activity.SPRING_SWEEP,), "stator_percent": (-93.0, -13.0),
        "file": "waveBotCtrlMdl_2023_09_18_15_15_54"},
    18: {"activities": (Activity.SINE, Activity.CHIRP), "wave_series": (),
         "amplitudes": tuple(map(Amplitude, (10.0, 20.0, 30.0, 40.0, 10.0)))},
    22: {"spring": Spring(-12000.0, "E24"), "amplitudes": (Amplitude(10.0), Amplitude(20.0)),
         "activities": (Activity.MULTISINE,), "condition": Condition.SERIOUS},
    24: {"spring": Spring(-12000.0, "E26"), "condition": Condition.PLAIN, "waves": (CALM,),
         "order": tuple(Amplitude(a, w) for a in (10.0, 20.0, 30.0) for w in "AB")},
    33: {"wave_series": (10,), "waves": (regular(0.254, 0.5),), "surge": "by hand",
         "spring": Spring(10000.0, "E35"), "matrix": "", "gains": ()},
    35: {"wave_series": (13, 14, 15), "waves": tuple(regular(0.127, f) for f in (0.4, 0.5, 0.6)),
         "gains": (Gain("heave", "kp", (), "E37"),
                   Gain("heave", "ki", (500.0, 1000.0, 1500.0), "E37"))},
    42: {"wave_series": (21,), "waves": (jonswap(0.127, 2.5, "Hz", 300.0, "4A"),),
         "matrix": "GainMatrix005", "spring": Spring(-8000.0, "E44"),
         "condition": Condition.WAVES_END_EARLY, "amplitudes": ()},
    48: {"matrix": "GainMatrix009", "gains": (
        Gain("heave", "kp", (-2000.0, -1500.0, -1000.0), "F50"),
        Gain("heave", "ki", (2000.0, 2500.0, 3000.0, 3500.0), "F50"))},
    54: {"wave_series": (33,), "file": "", "matrix": "GainMatrix010_2", "spring": None,
         "file_text": "ejckcbidtibivngcjvclnelujbkujchvhihfnkttgiec", "recorded": ""},
    62: {"wave_series": (38,), "waves": (jonswap(0.254, 2.5, "Hz", 300.0, "6A"),),
         "matrix": "GainMatrix006_2", "spring": Spring(-6152.0, "E65")},
    83: {"wave_series": (56,), "waves": (jonswap(0.254, 1.58, "s", 300.0, "23A"),),
         "matrix": "GainMatrix019_1", "spring": Spring(-6152.0, "E86")},
    97: {"wave_series": (66,), "waves": (Wave(WaveKind.PINK, code="PINKB"),),
         "activities": (Activity.MULTISINE,), "amplitudes": (Amplitude(20.0),),
         "condition": Condition.COMPROMISED},
    112: {"wave_series": (77,), "waves": (regular(0.127, 0.5),), "matrix": "GainMatrix025_2",
          "drive": "custom", "scheme": "SVPWM", "bus_voltage_v": 150.0, "surge": ""},
    123: {"wave_series": (87,), "waves": (regular(0.0635, 0.3),), "matrix": "GainMatrix026",
          "drive": "custom", "scheme": "Hyst", "notes": ""},
    132: {"wave_series": (95,), "waves": (jonswap(0.254, 2.5, "s", None, "6A"),),
          "matrix": "GainMatrix027", "scheme": "SVPWM", "recorded": "2023-10-04T04:42:02"},
    140: {"wave_series": (103,), "waves": (regular(0.127, 0.5),), "matrix": "GainMatrix028",
          "drive": "COTS", "scheme": "", "surge": "enabled"},
    141: {"waves": (regular(0.127, 0.6), CALM), "spring": Spring(-3000.0, "E146"),
          "activities": (Activity.GAIN_MATRIX, Activity.MULTISINE, Activity.RAMPS),
          "matrix": "GainMatrix030", "drive": "COTS", "amplitudes": ()},
}  # fmt: skip
"""Expected entries, read from the sheet by eye."""


@pytest.mark.parametrize("run", BY_HAND)
def test_entries_read_by_hand(log: RunLog, run: int) -> None:
    entry = log.find(run)
    for field, expected in BY_HAND[run].items():
        value = getattr(entry, field)
        if field == "waves":
            assert [w._replace(frequency_hz=0, period_s=0) for w in value] == [
                w._replace(frequency_hz=0, period_s=0) for w in expected
            ]
            for wave, condition in zip(value, expected, strict=True):
                assert wave.frequency_hz == pytest.approx(condition.frequency_hz)
                assert wave.period_s == pytest.approx(condition.period_s)
        else:
            assert value == expected, field
