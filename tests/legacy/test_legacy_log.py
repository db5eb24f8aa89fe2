"""Reading of test logs: waves, settings, remarks and links of synthetic logs."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import openpyxl
import pytest
from log_books import COLUMNS, write_log
from openpyxl.styles.colors import Color

from rig.config.problems import ConfigError
from rig.interop.legacy.testlog import RunLog, find_links, read_log
from rig.interop.legacy.testlog.entry import (
    Amplitude,
    Bias,
    Cell,
    Condition,
    Gain,
    Remark,
    RemarkKind,
    Spring,
    WaveKind,
)
from rig.interop.legacy.testlog.settings import (
    SEAS,
    read_bias,
    read_settings,
    read_waves,
)

FILE = "waveBotCtrlMdl_2023_09_2{}_04_46_26"
K = RemarkKind


def read_rows(folder: Path, *rows: tuple[object, ...], **more: Any) -> RunLog:
    return read_log(write_log(folder / "log.xlsx", *rows, **more))


def log_row(number: int, **cells: object) -> tuple[object, ...]:
    defaults = {
        "series": None,
        "file": FILE.format(number),
        "waves": "None",
        "rig": "",
        "notes": "",
    }
    return (f"T_{number:03d}", *(defaults | cells).values())


def kinds(parsed: RunLog, number: int) -> list[RemarkKind]:
    return [remark.kind for remark in parsed.find(number).remarks]


def refusal(action: Any) -> str:
    with pytest.raises(ConfigError) as caught:
        action()
    return caught.value.text()


@pytest.mark.parametrize(
    ("text", "amplitude", "hs", "frequency", "written", "remarks"),
    [
        ("0.5 Hz Regular wave, 5 inch AMPLITUDE", 0.127, None, 0.5, "Hz", []),
        ("0.4 Hz regular wave, 2.5inch amplitude", 0.0635, None, 0.4, "Hz", []),
        ("0.3 Hz 5 inch regular", 0.127, None, 0.3, "Hz", [K.HEIGHT_UNSPECIFIED]),
        ("0.3 Hz Regular wave, 5 inch (0.127m) AMPLITUDE", 0.127, None, 0.3, "Hz", []),
        ("0.3 Hz Regular wave, 5 inch (0.254m) AMPLITUDE", 0.127, None, 0.3, "Hz",
         [K.HEIGHT_DISAGREES]),
        ("0.4 Hz JONSWAP 10 inch Hs gamma = 3.3, 300s repeat 6A", None, 0.254, 0.4, "Hz", []),
        ('1.58 s 5" JONSWAP gamma = 3.3, 300s repeat 2A', None, 0.127, 1 / 1.58, "s",
         [K.HEIGHT_UNSPECIFIED]),
        ('3.5 s 5" Hs JONSWAP 8A gamma 3.3', None, 0.127, 1 / 3.5, "s", [K.SEA_NOT_IN_TABLE]),
        ('2.5 s 5" Hs JONSWAP 4A gamma 2', None, 0.127, 0.4, "s", [K.SEA_NOT_IN_TABLE]),
    ],
)  # fmt: skip
def test_a_height_is_an_amplitude_or_hs_and_never_both(
    text: str, amplitude: Any, hs: Any, frequency: float, written: str, remarks: list[Any]
) -> None:
    parsed = read_waves(text)
    (wave,) = parsed.waves
    assert (wave.amplitude_m, wave.hs_m, wave.written) == (amplitude, hs, written)
    assert wave.frequency_hz == pytest.approx(frequency)
    assert wave.period_s == pytest.approx(1 / frequency)
    assert [kind for kind, _ in parsed.remarks] == remarks


def test_every_sea_of_the_reports_table_is_known() -> None:
    for hs, tp in SEAS:
        (wave,) = read_waves(f'{tp} s {hs / 0.0254:g}" Hs JONSWAP gamma 3.3').waves
        assert wave.hs_m == pytest.approx(hs)
        assert (wave.kind, wave.gamma, wave.repeat_s) == (WaveKind.JONSWAP, 3.3, None)


def test_several_waves_and_none() -> None:
    several = read_waves("[0.4 Hz:0.1:0.6] Regular wave, 5 inch AMPLITUDE").waves
    assert [wave.frequency_hz for wave in several] == [0.4, 0.5, 0.6]
    mixed = read_waves("0.6 Hz 5 inch AMPLITUDE regular; NONE")
    assert [wave.kind for wave in mixed.waves] == [WaveKind.REGULAR, WaveKind.CALM]
    assert [kind for kind, _ in mixed.remarks] == [K.WAVES_MIXED]
    dry = read_waves("None; no buoy installed. Empty stage")
    assert [wave.kind for wave in dry.waves] == [WaveKind.CALM]
    assert [kind for kind, _ in dry.remarks] == [K.NO_WATER]
    pink = read_waves("PINKB medium")
    assert (pink.waves[0].kind, pink.waves[0].code) == (WaveKind.PINK, "PINKB")
    for text in ("Wavemaker powering up", "0 Hz Regular wave, 5 inch", "5 inch regular", ""):
        assert read_waves(text).waves == ()
        assert [kind for kind, _ in read_waves(text).remarks] == [K.WAVES_UNREADABLE]


def test_wave_name_is_not_read_as_a_current() -> None:
    (wave,) = read_waves("0.4 Hz JONSWAP 5 inch Hs gamma = 3.3, 300s repeat 4A").waves
    assert (wave.code, wave.repeat_s) == ("4A", 300.0)


def settings(wavebot: str, notes: str = "") -> SimpleNamespace:
    remarks: list[Remark] = []
    found = read_settings(Cell("E1", wavebot), Cell("F1", notes), remarks)
    return SimpleNamespace(**found, remarks=remarks)


def remarked(parsed: SimpleNamespace) -> list[tuple[RemarkKind, str]]:
    return [(remark.kind, remark.cell) for remark in parsed.remarks]


@pytest.mark.parametrize(
    ("wavebot", "rate"),
    [
        ("multisine, mag spring @ +10kN/m", 10000.0),
        ("magspring -12kN/m; hKi = 500:500:1500", -12000.0),
        ("GainMatrix005, -8000 springK", -8000.0),
        ("GainMatrix006_2, magK=-6152", -6152.0),
        ("GainMatrix014 spring -9228", -9228.0),
        ("GainMatrix019_3, weak positive spring 4164", 4164.0),
        ("Spring at -2307 N/m, SVPWM", -2307.0),
        ("springK=-3000, ramps with spring at -3000 N/m", -3000.0),
        ("GainMatrix022; zero spring rate", 0.0),
        ("GainMatrix010", None),
        ("mag spring sweep; stator position [-93,-13]", None),
    ],
)
def test_spring_rates_in_free_text(wavebot: str, rate: float | None) -> None:
    parsed = settings(wavebot)
    assert parsed.spring == (None if rate is None else Spring(rate, "E1"))


def test_spring_rates_that_are_doubtful_become_remarks() -> None:
    parsed = settings("springK=-3000, spring at -2307")
    assert (parsed.spring, remarked(parsed)) == (None, [(K.SPRING_SEVERAL, "E1")])
    for text in ("GainMatrix010_2; spring rate corrected", "ramps, mag spring home"):
        assert remarked(settings(text)) == [(K.SPRING_UNSPECIFIED, "E1")]
    noted = settings("GainMatrix024", "varies Kp, magK=-7620: resistors left off")
    assert noted.spring == Spring(-7620.0, "F1")
    assert remarked(noted) == [(K.SPRING_IN_NOTES, "F1")]
    planned = settings("GainMatrix005", "this is -8000 magSpring, plan to run -10000 and -12000")
    assert planned.spring is None


def test_letters_after_currents_are_amperes_or_phase_realisations() -> None:
    assert settings("Ramps [10A,20A,45A]").amplitudes == (
        Amplitude(10.0), Amplitude(20.0), Amplitude(45.0),
    )  # fmt: skip
    assert settings("multisine [10A,10B]").amplitudes == (
        Amplitude(10.0, "A"),
        Amplitude(10.0, "B"),
    )
    assert settings("multisine [10;20]amps waveform A").amplitudes == (
        Amplitude(10.0), Amplitude(20.0),
    )  # fmt: skip
    assert settings("Sinusoids 10A and freq [0.25,0.3 ]").amplitudes == (Amplitude(10.0),)
    unknown = settings("multisine [10;??]amps")
    assert unknown.amplitudes == (Amplitude(10.0),)
    assert remarked(unknown) == [(K.AMPLITUDE_UNKNOWN, "E1")]
    noted = settings("multisine [10;20]amps", "[10A; 10B; 20A], 30A splash, 3A threshold")
    assert noted.order == (Amplitude(10.0, "A"), Amplitude(10.0, "B"), Amplitude(20.0, "A"))
    assert settings("[A,B] 2.5 repeats").amplitudes == ()


def test_gains_and_the_range_that_matlab_takes_as_empty() -> None:
    parsed = settings("hKp = -3000:-500:-1000; then hKi = 500:500:1500, surge Kp = -2500")
    assert parsed.gains == (
        Gain("heave", "kp", (), "E1"),
        Gain("heave", "ki", (500.0, 1000.0, 1500.0), "E1"),
        Gain("surge", "kp", (-2500.0,), "E1"),
    )
    assert remarked(parsed) == [(K.RANGE_EMPTY, "E1")]
    assert settings("", "Kp=[-2000:500: -1000]").gains[0].values == (-2000.0, -1500.0, -1000.0)
    assert settings("springK=-3000, magK=-1, fixed KpKi").gains == ()


def test_drive_scheme_and_surge() -> None:
    parsed = settings("ramps w/ custom drive, surge is disabled, SVPWM")
    assert (parsed.drive, parsed.drive_source, parsed.scheme, parsed.surge) == (
        "custom", "E1", "SVPWM", "disabled",
    )  # fmt: skip
    parsed = settings("GainMatrix028", "*** RUN WITH AMC DRIVE*** surge drive ENABLED")
    assert (parsed.drive, parsed.drive_source, parsed.scheme, parsed.surge) == (
        "COTS",
        "F1",
        "",
        "enabled",
    )
    assert remarked(settings("surge drive disables, SVPM")) == [
        (K.SCHEME_MISSPELT, "E1"), (K.SURGE_MISSPELT, "E1"),
    ]  # fmt: skip
    several = settings("GainMatrix026", "one each [SVPWM;Hyst], varies driveHystTol")
    assert (several.scheme, remarked(several)) == (
        "",
        [(K.SCHEME_IN_NOTES, "F1"), (K.SCHEME_SEVERAL, "F1")],
    )
    other = settings("SineTri", "run 2 w/ Hyst")
    assert (other.scheme, remarked(other)) == ("SineTri", [(K.SCHEME_SEVERAL, "F1")])
    assert settings("SVPWM EXCEPT DC BUS at 150V (ran manually)").bus_voltage_v == 150.0
    assert settings("spring +10kN/m, surge Kp adjusted manually").surge == "by hand"


@pytest.mark.parametrize(
    ("text", "bias"),
    [
        ("offset noticed: heave position bias corrected after this run", ("corrected", "after")),
        ("heave encoder bias correction attempted but probably wrong.", ("attempted", "")),
        ("heave encoder and string pot bias adjusted before this run", ("corrected", "before")),
        ("Heave encoder zeroed before this run. Vary x", ("zeroed", "before")),
        ("A more substantial offset in heave encoder was noted after this event", ("seen", "")),
        ("mag encoder reading -76.5 degree offset.", None),
    ],
)
def test_actions_on_the_zero_of_the_position(text: str, bias: Any) -> None:
    assert read_bias(Cell("F1", text)) == (None if bias is None else Bias(*bias, "F1"))


def test_rows_without_run_id_are_separators(tmp_path: Path) -> None:
    parsed = read_rows(
        tmp_path,
        log_row(1),
        (None, None, "*** MAP CORRECTED", "by 0.7690"),
        log_row(2),
        ("*****", None, "CUSTOM DRIVE from here"),
        log_row(4),
        (None, None, None, None, None, "the end"),
    )
    assert [entry.run for entry in parsed.entries] == [1, 2, 4]
    assert [(s.row, s.cell, s.text, s.before_run) for s in parsed.separators] == [
        (3, "C3", "*** MAP CORRECTED / by 0.7690", 2),
        (5, "C5", "CUSTOM DRIVE from here", 4),
        (7, "F7", "the end", 0),
    ]
    assert [(e.drive, e.drive_source) for e in parsed.entries] == [
        ("COTS", "from the start"), ("COTS", "from the start"), ("custom", "C5"),
    ]  # fmt: skip
    assert parsed.find(2).name == "T_002"
    with pytest.raises(KeyError, match=r"it has 1 \.\. 4"):
        parsed.find(3)


def test_drive_carried_over_from_another_run_is_remarked(tmp_path: Path) -> None:
    parsed = read_rows(
        tmp_path, log_row(1, notes="RUN WITH CUSTOM DRIVE"), log_row(2), log_row(3, rig="AMC drive")
    )
    assert [(e.drive, e.drive_source) for e in parsed.entries] == [
        ("custom", "F2"), ("custom", "F2"), ("COTS", "E4"),
    ]  # fmt: skip
    assert [K.DRIVE_CARRIED in kinds(parsed, number) for number in (1, 2, 3)] == [
        False,
        True,
        False,
    ]


def test_invalid_file_names_are_remarked(tmp_path: Path) -> None:
    parsed = read_rows(
        tmp_path,
        log_row(1, file=None),
        log_row(2, file="waveBotCtrlMdl_2023_09_29___"),
        log_row(3, file="ejckcbdeftghijklnrtuvhbtdcvgfbeu"),
        log_row(5),
        log_row(6, file=FILE.format(5)),
        log_row(7, file=FILE.format(4)),
    )
    assert kinds(parsed, 1) == [K.FILE_MISSING]
    assert kinds(parsed, 2) == [K.FILE_PARTIAL]
    assert kinds(parsed, 3) == [K.FILE_NO_NAME]
    assert kinds(parsed, 5) == [K.FILE_SHARED]
    assert kinds(parsed, 7) == [K.FILE_ORDER]
    assert [entry.file for entry in parsed.entries[:3]] == ["", "", ""]
    assert (parsed.find(7).recorded, parsed.find(3).recorded) == ("2023-09-24T04:46:26", "")
    assert find_links(parsed).shared_files == {FILE.format(5): (5, 6)}


def test_wave_series_are_linked_to_runs(tmp_path: Path) -> None:
    regular = "0.5 Hz Regular wave, 5 inch AMPLITUDE"
    parsed = read_rows(
        tmp_path,
        log_row(1, series=8, waves=regular),
        log_row(2, series="9,12", waves=regular),
        log_row(3, series=9.0, waves=regular),
        log_row(4, waves=regular),
        log_row(5, series="see 9", waves=regular),
        log_row(6),
    )
    assert find_links(parsed).wave_series == {8: (1,), 9: (2, 3), 12: (2,)}
    assert find_links(parsed).unnamed_series == (10, 11)
    assert kinds(parsed, 2) == [K.SERIES_SEVERAL]
    assert kinds(parsed, 4) == [K.SERIES_MISSING]
    assert kinds(parsed, 5) == [K.SERIES_UNREADABLE]
    assert kinds(parsed, 6) == []


def test_repeats_of_a_gain_matrix_list_the_differing_settings(tmp_path: Path) -> None:
    parsed = read_rows(
        tmp_path,
        log_row(1, rig="GainMatrix026 [SVPWM]"),
        log_row(2, rig="GainMatrix026. DPWM"),
        log_row(3, rig="GainMatrix026_1"),
        log_row(4, rig="GainMatrix030"),
        log_row(5, rig="GainMatrix030;"),
    )
    assert find_links(parsed).matrices == {
        "GainMatrix026": (1, 2), "GainMatrix026_1": (3,), "GainMatrix030": (4, 5),
    }  # fmt: skip
    assert [tuple(repeat) for repeat in find_links(parsed).repeats] == [
        ("GainMatrix026", (1, 2), ("scheme",)),
        ("GainMatrix030", (4, 5), ()),
    ]


def test_rate_close_to_another_is_remarked(tmp_path: Path) -> None:
    rates = (-9228, -9228, -9228, -9223, -2307, -2400)
    parsed = read_rows(
        tmp_path, *(log_row(i, rig=f"spring {rate}") for i, rate in enumerate(rates, start=1))
    )
    assert [number for number in range(1, 7) if K.SPRING_CLOSE in kinds(parsed, number)] == [4]


def test_colour_of_a_row_gives_its_condition(tmp_path: Path) -> None:
    colours = {
        2: Color(theme=4, tint=0.6),
        3: Color(theme=7),  # theme index here, RGB value in the legend
        4: Color(rgb="FF8064A2"),
        5: Color(theme=8, tint=0.6),
    }
    parsed = read_rows(tmp_path, *(log_row(i) for i in range(1, 6)), colours=colours)
    assert [entry.condition for entry in parsed.entries] == [
        Condition.UNUSUAL, Condition.SERIOUS, Condition.SERIOUS, Condition.UNKNOWN, Condition.PLAIN,
    ]  # fmt: skip
    assert kinds(parsed, 4) == [K.COLOUR_UNKNOWN]


def test_invalid_log_is_refused_with_every_problem(tmp_path: Path) -> None:
    rows = (("T_001 ",), ("12",), ("T_1",), ("T_x",))
    message = refusal(lambda: read_rows(tmp_path, *rows))
    assert "log.xlsx:3: Run ID: '12' is not a run ID; allowed as MASK4_001" in message
    assert "log.xlsx:4: Run ID: T_1 occurs twice, first in row 2" in message
    assert "log.xlsx:5: Run ID: 'T_x'" in message
    assert "no run in the log" in refusal(lambda: read_rows(tmp_path))
    bad = (*COLUMNS[:3], "Sea", *COLUMNS[4:])
    assert "no sheet has the columns of a test log" in refusal(
        lambda: read_rows(tmp_path, columns=bad)
    )
    (tmp_path / "x.xlsx").write_bytes(b"PK\x03\x04")
    assert "not readable as a workbook" in refusal(lambda: read_log(tmp_path / "x.xlsx"))
    assert "cannot be read" in refusal(lambda: read_log(tmp_path / "none.xlsx"))


def test_columns_may_have_any_order(tmp_path: Path) -> None:
    path = tmp_path / "l.xlsx"
    workbook = openpyxl.Workbook()
    workbook.active.append(["More", *(name.upper() for name in reversed(COLUMNS))])
    workbook.active.append(["x", "PTP lost", "GainMatrix1", "None", FILE.format(1), None, "T_001"])
    workbook.save(path)
    (entry,) = read_log(path).entries
    assert (entry.matrix, entry.notes, entry.recorded) == (
        "GainMatrix1", "PTP lost", "2023-09-21T04:46:26",
    )  # fmt: skip
    assert [(r.kind, r.cell) for r in entry.remarks] == [(K.TIME_SYNC, "B2")]
