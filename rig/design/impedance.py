"""Designing the sections of Z_c(s), force on the body per velocity, outside the loop.

A rational Z_c is given by coefficients and turned into second-order sections by the bilinear
transform s = (2 / T) (z - 1) / (z + 1), which keeps a stable filter stable and a passive one
passive. The sections stand in cascade: they follow from poles and zeros alone, and a pole that
occurs several times does no harm; parallel sections need partial fractions, which such a pole
makes ill-conditioned. The transform bends the frequency axis by (omega T)^2 / 12, 1.3e-5 at 2 Hz
and 1 kHz, so nothing is pre-warped; what comes out is compared with Z_c(j omega) all the same,
because rounding and slow ticks can spoil it too.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from controllers.biquads import Biquad

Complexes = npt.NDArray[np.complex128]
Floats = npt.NDArray[np.float64]

BAND = (0.05, 2.0)  # Hz, in which there are waves
# Of |Z_c|, or of a hundredth of its largest in the band where it is smaller than that (a zero on
# the frequency axis): a hundredth of how well a measured impedance is known, 10 %.
TOLERANCE = 1e-3
_NOT_FINITE = "the response is not finite: coefficients or poles are too large or too small"
_FREQUENCIES = 400  # in the band, by equal ratios: 1 % apart


def design(
    numerator: Sequence[float], denominator: Sequence[float], dt: float
) -> tuple[Biquad, ...]:
    """Sections in cascade for Z_c(s) = numerator / denominator, N*s/m, at the period ``dt`` (s).

    Coefficients come by falling powers of s. A Z_c of zero gives no section. ValueError, with all
    that is wrong: no or not finite coefficients, a denominator of zero, more zeros than poles,
    poles that are not stable, a response that is not finite, or one that differs from
    Z_c(j omega) by more than `TOLERANCE` in `BAND`.
    """
    problems: list[str] = []
    if not (np.isfinite(dt) and 0.0 < dt <= 0.25 / BAND[1]):
        problems.append(f"the period is {dt:g} s, allowed are more than 0 up to {0.25 / BAND[1]:g}")
    top = _polynomial("numerator", numerator, problems)
    bottom = _polynomial("denominator", denominator, problems)
    if not problems and bottom.size == 0:
        problems.append("the denominator is zero")
    if not problems and top.size > bottom.size:
        problems.append(
            f"not proper: the numerator has order {top.size - 1}, the denominator only"
            f" {bottom.size - 1} (force per acceleration is Km)"
        )
    if problems:
        raise ValueError("Z_c: " + "; ".join(problems))
    if top.size == 0:
        return ()
    with np.errstate(all="ignore"):  # what is not finite is asked for
        top, bottom = top / bottom[0], bottom / bottom[0]
        monic = top / top[0]
    if not np.all(np.isfinite([*top, *bottom, *monic])):
        raise ValueError(f"Z_c: {_NOT_FINITE}")
    poles = _roots(bottom)
    unstable = poles[poles.real >= 0.0]
    if unstable.size:
        named = ", ".join(f"{pole.real:.3g}{pole.imag:+.3g}j" for pole in unstable)
        raise ValueError(
            f"Z_c: not stable: poles at {named} rad/s, allowed are real parts below 0 (an"
            " integrator of velocity is Ki)"
        )
    sections = _sections(_roots(monic), poles, float(top[0]), dt)
    wrong = _wrong(top, bottom, sections, dt)
    if wrong:
        raise ValueError(f"Z_c: {wrong}")
    return sections


def response(sections: Sequence[Biquad], f_hz: npt.ArrayLike, dt: float) -> Complexes:
    """Z_c of the sections as they run, complex, at ``f_hz``; 0 of no section.

    Phasors are exp(+j omega t). Hold and delay of the loop are not in it.
    """
    back = np.exp(-2j * np.pi * np.asarray(f_hz, dtype=float) * dt)
    if not sections:
        return np.zeros_like(back)
    out = np.ones_like(back)
    for b0, b1, b2, a1, a2 in sections:
        out = out * (b0 + back * (b1 + back * b2)) / (1.0 + back * (a1 + back * a2))
    return out


def evaluate(
    numerator: Sequence[float], denominator: Sequence[float], f_hz: npt.ArrayLike
) -> Complexes:
    """Z_c(j omega) itself at ``f_hz``, complex."""
    s = 2j * np.pi * np.asarray(f_hz, dtype=float)
    return np.asarray(np.polyval(numerator, s) / np.polyval(denominator, s), dtype=complex)


def _polynomial(name: str, coefficients: Sequence[float], problems: list[str]) -> Floats:
    """The coefficients without leading zeros; empty for zero."""
    values = np.asarray(coefficients, dtype=float)
    if values.ndim != 1 or values.size == 0:
        problems.append(f"the {name} needs a list of at least one coefficient")
        return np.zeros(0)
    if not np.all(np.isfinite(values)):
        problems.append(f"the {name} has coefficients that are not finite: {values.tolist()}")
        return np.zeros(0)
    return np.trim_zeros(values, "f")


def _roots(polynomial: Floats) -> Complexes:
    with np.errstate(all="ignore"):
        return np.asarray(np.roots(polynomial), dtype=complex)


def _sections(zeros: Complexes, poles: Complexes, gain: float, dt: float) -> tuple[Biquad, ...]:
    from scipy import signal  # noqa: PLC0415 - half a second that no other law need pay

    with np.errstate(all="ignore"):
        z, p, k = signal.bilinear_zpk(zeros, poles, gain, fs=1.0 / dt)
        if not (np.all(np.isfinite(z)) and np.all(np.isfinite(p)) and np.isfinite(k)):
            return (Biquad(np.nan, 0.0, 0.0, 0.0, 0.0),)
        rows = signal.zpk2sos(z, p, k)
    return tuple(
        Biquad(float(b0), float(b1), float(b2), float(a1), float(a2))
        for b0, b1, b2, _, a1, a2 in rows
    )


def _wrong(top: Floats, bottom: Floats, sections: tuple[Biquad, ...], dt: float) -> str:
    """What is wrong with the sections as rounded, if anything: stable, finite, the response."""
    if not all(np.isfinite(number) for section in sections for number in section):
        return _NOT_FINITE
    # Both roots of z^2 + a1 z + a2 lie inside the unit circle just then (Jury's conditions).
    if not all(abs(one.a2) < 1.0 and abs(one.a1) < 1.0 + one.a2 for one in sections):
        return "not stable at this period: a pole has too little damping to be told from none"
    f_hz = np.geomspace(*BAND, _FREQUENCIES)
    with np.errstate(all="ignore"):
        wanted, got = evaluate(top.tolist(), bottom.tolist(), f_hz), response(sections, f_hz, dt)
        largest = np.max(np.abs(wanted))
        error = np.abs(got - wanted) / np.maximum(np.abs(wanted), 0.01 * largest)
        ends = response(sections, [0.0, 0.5 / dt], dt)
    if not (np.all(np.isfinite(error)) and np.all(np.isfinite(ends))):
        return f"the response is not finite between 0 and {0.5 / dt:g} Hz"
    worst = int(np.argmax(error))
    if error[worst] > TOLERANCE:
        return (
            f"at a period of {dt:g} s the response differs from Z_c(j omega) by"
            f" {100.0 * error[worst]:.3g} % at {f_hz[worst]:.3g} Hz, allowed is"
            f" {100.0 * TOLERANCE:g} %"
        )
    return ""
