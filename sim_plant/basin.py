"""The wave basin around the device: what its probes see. numpy, at the probes' own 50 Hz.

A probe at (x, y) sees the undisturbed wave of its place, Re(sum a_k e^{i(k_k x - omega_k t)}), long
crests travelling to +x in deep water, plus the wave that the heaving hull radiates. Not modelled:
the wave scattered by the hull, the one radiated by surge, reflections from the basin's walls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sim_plant.bem import Bem, Complexes, Floats
from sim_plant.sensors import Channel, measure
from sim_plant.units import Hertz, Metre, MetrePerSecond, Second
from sim_plant.waves import GRAVITY, Sea, elevation_at

RATE = 50.0  # Hz, of the basin's data acquisition
DENSITY = 1000.0  # kg/m3, of the BEM files
NEAREST = 3.0  # m from the hull's axis: nearer, the hull's own flow is no wave
FADES: tuple[Hertz, Hertz] = (1.7, 2.0)  # the radiated wave is taken out between these
SPACING = 5  # samples between taps: 0.1 s; the hull does not move at 8 Hz and above


class Probe(NamedTuple):
    """Where a probe stands: along the waves, across them, from the device."""

    x: Metre
    y: Metre


def radiated(bem: Bem, radius: Metre, frequency: Floats) -> Complexes:
    """Give the far-field elevation per heave velocity, m per m/s, e^{-i omega t}.

    Magnitude by energy flux, |a|/|v| = sqrt(B / (2 pi r rho g c_g)) with c_g = g/(2 omega); phase
    k r + arg(Fe) + 3/4 pi, which is Haskind's relation for an axisymmetric hull, less the near
    field's 1/(8 k r + 4/pi), which is that of a ring wave (Hankel function) to first order. Against
    capytaine's free surface: 5 % for k r of 2 to 8, 16 % at 0.2 Hz and 3 m. Zero at 0 Hz and, after
    a taper, above 2 Hz.
    """
    omega = 2.0 * np.pi * frequency
    grid = np.concatenate([[0.0], bem.frequency])
    damping = np.interp(frequency, grid, np.concatenate([[0.0], bem.damping]), right=0.0)
    turned = np.unwrap(np.angle(bem.excitation))
    lead = np.interp(frequency, grid, np.concatenate([[0.0], turned]))
    size = np.sqrt(np.maximum(damping, 0.0) * omega / (np.pi * radius * DENSITY * GRAVITY**2))
    begin, end = FADES
    along = np.clip((frequency - begin) / (end - begin), 0.0, 1.0)
    waves = omega**2 / GRAVITY * radius  # k r
    phase = waves - 1.0 / (8.0 * waves + 4.0 / np.pi) + lead + 0.75 * np.pi
    wave: Complexes = size * (0.5 + 0.5 * np.cos(np.pi * along)) * np.exp(1j * phase)
    return wave


def taps(bem: Bem, radius: Metre) -> Floats:
    """Give the causal filter from heave velocity to radiated elevation, one tap per 0.1 s.

    Least squares over 0.15-1.25 Hz relative to the wanted magnitude, loosely to zero elsewhere: the
    far field alone is not quite causal, so 1.0 % remain at 3 m and 0.6 % at 5 m over 0.2-1.2 Hz.
    """
    hull = (bem.frequency.tobytes(), bem.damping.tobytes(), bem.excitation.tobytes())
    return _taps(*hull, radius).copy()


@lru_cache(maxsize=16)  # worlds in one process mostly have the hull and probes of the one before
def _taps(frequencies: bytes, damping: bytes, excitation: bytes, radius: Metre) -> Floats:
    none = np.empty(0)
    bem = Bem(
        np.frombuffer(frequencies),
        none,
        np.frombuffer(damping),
        np.frombuffer(excitation, complex),
        0.0,
        0.0,
        math.inf,
    )
    step = SPACING / RATE
    slowest = 2.0 * 2.0 * math.pi * 1.3 * radius / GRAVITY  # r/c_g at 1.3 Hz
    count = math.ceil((slowest + 6.0) / step)
    frequency = np.linspace(0.0, 0.5 / step, 601)
    wanted = np.conj(radiated(bem, radius, frequency))  # e^{+i omega t}: a delay is e^{-i omega t}
    size = np.abs(wanted)
    most = float(size.max())
    inside = (frequency >= 0.15) & (frequency <= 1.25)
    weight = np.where(inside, 1.0 / np.maximum(size, 0.1 * most), 0.03 / most)
    turns = np.exp(-2j * np.pi * step * np.outer(frequency, np.arange(count))) * weight[:, None]
    matrix = np.vstack([turns.real, turns.imag])
    target = np.concatenate([(wanted * weight).real, (wanted * weight).imag])
    normal = matrix.T @ matrix
    normal += 1.0e-6 * np.trace(normal) / count * np.eye(count)
    return np.linalg.solve(normal, matrix.T @ target)


class Basin:
    """The probes of one basin: sampled at 50 Hz from the wave clock and the hull's velocity."""

    def __init__(
        self,
        sea: Sea,
        bem: Bem,
        probes: Sequence[Probe],
        channel: Channel,
        normals: Sequence[float],
        *,
        dt: Second,
        device: bool,
    ) -> None:
        """Raises ValueError for a probe nearer than `NEAREST` to a hull that is there."""
        radii = [math.sqrt(p.x * p.x + p.y * p.y) for p in probes]
        if device and min(radii) < NEAREST:
            raise ValueError(f"a probe must stand {NEAREST} m or more from the hull's axis")
        self._incident = np.column_stack([elevation_at(sea, p.x, dt) for p in probes])
        self._length = len(self._incident)
        self._channel = channel
        self._normals = normals
        filters = [taps(bem, radius) for radius in radii] if device else []
        longest = max([len(one) for one in filters], default=0)
        self._filters = np.array([np.pad(one, (0, longest - len(one))) for one in filters])
        self._taps = longest
        # Velocities, newest first; every SPACING-th in one row, and twice: any window is whole.
        self._past = np.zeros((SPACING, 2 * longest))
        self._samples = 0

    def sample(self, wave_tick: int, onset: float, velocity: MetrePerSecond) -> list[Metre]:
        """Give what every probe reads now and remember the hull's velocity (m/s).

        `wave_tick` counts ticks of the wave clock, negative while the wave maker stands; `onset` is
        its factor, the same everywhere in the basin.
        """
        clock = self._samples
        self._samples = clock + 1
        seen = [0.0] * self._incident.shape[1]
        if wave_tick >= 0:
            seen = [onset * x for x in self._incident[wave_tick % self._length].tolist()]
        if self._taps:
            past = self._past[clock % SPACING]
            start = self._taps - 1 - clock // SPACING % self._taps
            past[start] = past[start + self._taps] = velocity
            made = self._filters.dot(past[start : start + self._taps]).tolist()
            seen = [a + b for a, b in zip(seen, made, strict=True)]
        # Each probe walks through the noise table from another place.
        channel, normals = self._channel, self._normals
        return [measure(channel, x, clock + 9973 * i, normals) for i, x in enumerate(seen)]
