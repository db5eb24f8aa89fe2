"""Factors between units, by the definitions of the SI brochure."""

from __future__ import annotations

import math

import pytest

from rig.config.unit_factors import factor_note, key_note, key_unit, si_unit


@pytest.mark.parametrize(
    ("unit", "allowed", "factor"),
    [
        ("kN/m", "N/m", 1000.0),
        ("kN", "N", 1000.0),
        ("kN s/m", "N*s/m", 1000.0),
        ("kN·s/m", "N*s/m", 1000.0),
        ("N*s/mm", "N*s/m", 1000.0),
        ("mm", "m", 0.001),
        ("cm", "m", 0.01),
        ("kW", "W", 1000.0),
        ("MN/m", "N/m", 1e6),
        ("t", "kg", 1000.0),
        ("g", "kg", 0.001),
        ("mm^2", "m^2", 1e-6),
        ("kN*m*s/rad", "N*m*s/rad", 1000.0),
        ("deg", "rad", math.pi / 180.0),
        ("rpm", "rad/s", math.pi / 30.0),
        ("kV", "V", 1000.0),
        ("mohm", "ohm", 0.001),
        ("N*mm", "N*m", 0.001),
        ("lbf", "N", 4.4482216152605),
    ],
)
def test_factor_of_a_multiple(unit: str, allowed: str, factor: float) -> None:
    note = factor_note(unit, ["A", allowed])
    start, _, rest = note.partition(" = ")
    assert start == f"write the value in {allowed}, 1 {unit}"
    assert rest.endswith(f" {allowed}")
    assert float(rest.split()[0]) == pytest.approx(factor, rel=1e-9)


@pytest.mark.parametrize("unit", ["kN/m", "parsec", "", "N//m", "/s", "N/(m/s)", "kN m"])
def test_unit_of_another_quantity_has_no_factor(unit: str) -> None:
    assert factor_note(unit, ["A", "kg", "furlong"]) == ""


def test_other_spelling_of_a_unit() -> None:
    assert factor_note("N s/m", ["N*s/m"]) == "write N*s/m"
    assert factor_note("N*s/m", ["N*s/m"]) == ""


@pytest.mark.parametrize(
    ("key", "known", "note"),
    [
        ("spring_kn_per_m", "spring_n_per_m", "write spring_n_per_m, 1 kN/m = 1000 N/m"),
        ("kp_kn_s_per_m", "kp_n_s_per_m", "write kp_n_s_per_m, 1 kN*s/m = 1000 N*s/m"),
        ("amplitude_mm", "amplitude_m", "write amplitude_m, 1 mm = 0.001 m"),
        ("tilt_deg", "tilt_rad", "write tilt_rad, 1 deg = 0.01745329252 rad"),
        ("latch_ms", "latch_s", "write latch_s, 1 ms = 0.001 s"),
        ("other_kn_per_m", "spring_n_per_m", ""),
        ("spring_kn", "spring_n_per_m", ""),
        ("spring_n_per_m", "spring_n_per_m", ""),
        ("name", "spring_n_per_m", ""),
    ],
)
def test_key_with_a_multiple(key: str, known: str, note: str) -> None:
    assert key_note(key, ["name", known]) == note


@pytest.mark.parametrize(
    ("unit", "si"),
    [
        ("kN*s/m", "N*s/m"), ("N*s/mm", "N*s/m"), ("g", "kg"), ("mg", "kg"), ("kg", "kg"),
        ("mm^2", "m^2"), ("deg", "deg"), ("1", "1"), ("%", "%"), ("N*m*s/rad", "N*m*s/rad"),
        ("ms", "s"), ("counts", "counts"), ("m", "m"), ("Hz", "Hz"),
    ],
)  # fmt: skip
def test_si_unit(unit: str, si: str) -> None:
    assert si_unit(unit) == si


def test_unit_of_a_key() -> None:
    assert [key_unit(key) for key in ("c0_kn_s_per_m", "c0_n_s_per_m", "zeta", "per_m")] == [
        "kN*s/m", "N*s/m", "", "m",
    ]  # fmt: skip
