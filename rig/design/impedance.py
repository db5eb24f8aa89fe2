"""Design of the sections of Z_c(s), force on the body per velocity, outside the loop.

The bilinear transform s = (2 / T) (z - 1) / (z + 1) turns the coefficients of a rational Z_c into
second-order sections; it keeps a stable filter stable and a passive one passive. The sections are
in cascade, because a cascade follows from poles and zeros alone and a repeated pole does no harm;
parallel sections need partial fractions, which a repeated pole makes ill-conditioned. The transform
warps the frequency axis by (omega T)^2 / 12, 1.3e-5 at 2 Hz and 1 kHz, so the design does not
pre-warp. It still compares the result with Z_c(j omega), because rounding and slow ticks can spoil
the response too.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from controllers.biquads import Biquad
from rig.spectra.periods import Complexes, Floats

BAND = (0.05, 2.0)  # Hz, band of the waves
# Relative to |Z_c|, or to a hundredth of its largest value in the band where |Z_c| is smaller than
# that (a zero on the frequency axis). One hundredth of the 10 % to which an impedance is measured.
TOLERANCE = 1e-3
_NOT_FINITE_MESSAGE = "the response is not finite: coefficients or poles are too large or too small"
_FREQUENCY_COUNT = 400  # in the band, logarithmically spaced, 1 % apart


def design(
    numerator: Sequence[float], denominator: Sequence[float], dt: float
) -> tuple[Biquad, ...]:
    """Return cascaded sections of Z_c(s) = numerator / denominator, N*s/m, at period ``dt`` (s).

    Coefficients are in descending powers of s. A Z_c of zero gives no section. Raises ValueError
    with a list of the problems: missing or non-finite coefficients, a zero denominator, more zeros
    than poles, unstable poles, a response that is not finite, or a response that differs from
    Z_c(j omega) by more than `TOLERANCE` in `BAND`.
    """
    problems: list[str] = []
    if not (np.isfinite(dt) and 0.0 < dt <= 0.25 / BAND[1]):
        problems.append(f"the period is {dt:g} s, allowed are more than 0 up to {0.25 / BAND[1]:g}")
    num = _polynomial("numerator", numerator, problems)
    den = _polynomial("denominator", denominator, problems)
    if not problems and den.size == 0:
        problems.append("the denominator is zero")
    if not problems and num.size > den.size:
        problems.append(
            f"not proper: the numerator has order {num.size - 1}, the denominator only"
            f" {den.size - 1} (force per acceleration is Km)"
        )
    if problems:
        raise ValueError("Z_c: " + "; ".join(problems))
    if num.size == 0:
        return ()
    with np.errstate(all="ignore"):  # non-finite results are checked below
        num, den = num / den[0], den / den[0]
        monic = num / num[0]
    if not np.all(np.isfinite([*num, *den, *monic])):
        raise ValueError(f"Z_c: {_NOT_FINITE_MESSAGE}")
    poles = _roots(den)
    unstable = poles[poles.real >= 0.0]
    if unstable.size:
        pole_list = ", ".join(f"{pole.real:.3g}{pole.imag:+.3g}j" for pole in unstable)
        raise ValueError(
            f"Z_c: not stable: poles at {pole_list} rad/s, allowed are real parts below 0 (an"
            " integrator of velocity is Ki)"
        )
    sections = _sections(_roots(monic), poles, float(num[0]), dt)
    problem = _find_problem(num, den, sections, dt)
    if problem:
        raise ValueError(f"Z_c: {problem}")
    return sections


def response(sections: Sequence[Biquad], f_hz: npt.ArrayLike, dt: float) -> Complexes:
    """Return Z_c of the discrete sections, complex, at ``f_hz`` (Hz); 0 for an empty cascade.

    Phasors are exp(+j omega t). Hold and delay of the loop are not included.
    """
    z_inv = np.exp(-2j * np.pi * np.asarray(f_hz, dtype=float) * dt)
    if not sections:
        return np.zeros_like(z_inv)
    total = np.ones_like(z_inv)
    for b0, b1, b2, a1, a2 in sections:
        total = total * (b0 + z_inv * (b1 + z_inv * b2)) / (1.0 + z_inv * (a1 + z_inv * a2))
    return total


def evaluate(
    numerator: Sequence[float], denominator: Sequence[float], f_hz: npt.ArrayLike
) -> Complexes:
    """Return the continuous Z_c(j omega) at ``f_hz`` (Hz), complex."""
    s = 2j * np.pi * np.asarray(f_hz, dtype=float)
    return np.asarray(np.polyval(numerator, s) / np.polyval(denominator, s), dtype=complex)


def _polynomial(name: str, coefficients: Sequence[float], problems: list[str]) -> Floats:
    """Return the coefficients without leading zeros; empty for a zero polynomial."""
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
    from scipy import signal  # noqa: PLC0415 - the import takes 0.5 s, which only this law needs

    with np.errstate(all="ignore"):
        z, p, k = signal.bilinear_zpk(zeros, poles, gain, fs=1.0 / dt)
        if not (np.all(np.isfinite(z)) and np.all(np.isfinite(p)) and np.isfinite(k)):
            return (Biquad(np.nan, 0.0, 0.0, 0.0, 0.0),)
        rows = signal.zpk2sos(z, p, k)
    return tuple(
        Biquad(float(b0), float(b1), float(b2), float(a1), float(a2))
        for b0, b1, b2, _, a1, a2 in rows
    )


def _find_problem(num: Floats, den: Floats, sections: tuple[Biquad, ...], dt: float) -> str:
    """Return the problem of the rounded sections, or "": not finite, not stable, wrong response."""
    if not all(np.isfinite(number) for section in sections for number in section):
        return _NOT_FINITE_MESSAGE
    # Jury's conditions: both roots of z^2 + a1 z + a2 lie inside the unit circle.
    if not all(abs(one.a2) < 1.0 and abs(one.a1) < 1.0 + one.a2 for one in sections):
        return "not stable at this period: the damping of a pole is lost in rounding"
    f_hz = np.geomspace(*BAND, _FREQUENCY_COUNT)
    with np.errstate(all="ignore"):
        target, actual = evaluate(num.tolist(), den.tolist(), f_hz), response(sections, f_hz, dt)
        largest = np.max(np.abs(target))
        error = np.abs(actual - target) / np.maximum(np.abs(target), 0.01 * largest)
        end_values = response(sections, [0.0, 0.5 / dt], dt)
    if not (np.all(np.isfinite(error)) and np.all(np.isfinite(end_values))):
        return f"the response is not finite between 0 and {0.5 / dt:g} Hz"
    worst = int(np.argmax(error))
    if error[worst] > TOLERANCE:
        return (
            f"at a period of {dt:g} s the response differs from Z_c(j omega) by"
            f" {100.0 * error[worst]:.3g} % at {f_hz[worst]:.3g} Hz, allowed is"
            f" {100.0 * TOLERANCE:g} %"
        )
    return ""
