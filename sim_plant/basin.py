"""Wave probes in the basin around the device, sampled at their own 50 Hz (numpy).

A probe at (x, y) measures the undisturbed wave at its position, Re(sum a_k e^{i(k_k x - omega_k
t)}), long crests travelling to +x in deep water, plus the wave that the heaving hull radiates. Not
modelled: the wave scattered by the hull, the wave radiated by surge, reflections from the basin's
walls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sim_plant.bem import Bem, Complexes, Floats
from sim_plant.sea_states import GRAVITY, Sea, elevation_at
from sim_plant.sensors import Channel, measure
from sim_plant.units import Hertz, Metre, MetrePerSecond, Second

SAMPLE_RATE = 50.0  # Hz, of the basin's data acquisition
DENSITY = 1000.0  # kg/m3, of the BEM files
MIN_PROBE_DISTANCE = 3.0  # m from the hull's axis: nearer, the near field of the hull is not a wave
TAPER_BAND: tuple[Hertz, Hertz] = (1.7, 2.0)  # the radiated wave is tapered to zero over this band
TAP_SPACING = 5  # samples between taps: 0.1 s; the hull does not move at 8 Hz and above


class Probe(NamedTuple):
    """Position of a probe relative to the device: x along the waves, y across them."""

    x: Metre
    y: Metre


def radiated_wave(bem: Bem, radius: Metre, frequency: Floats) -> Complexes:
    """Return the far-field elevation per heave velocity, m per m/s, e^{-i omega t}.

    Magnitude by energy flux, |a|/|v| = sqrt(B / (2 pi r rho g c_g)) with c_g = g/(2 omega); the
    phase is k r + arg(Fe) + 3/4 pi (Haskind's relation for an axisymmetric hull) minus the
    near-field term 1/(8 k r + 4/pi) (a ring wave, i.e. the Hankel function, to first order).
    Against capytaine's free surface: 5 % for k r of 2 to 8, 16 % at 0.2 Hz and 3 m. Zero at 0 Hz
    and, after a taper, above 2 Hz.
    """
    omega = 2.0 * np.pi * frequency
    grid = np.concatenate([[0.0], bem.frequency])
    damping = np.interp(frequency, grid, np.concatenate([[0.0], bem.damping]), right=0.0)
    excitation_phase = np.unwrap(np.angle(bem.excitation))
    phase_lead = np.interp(frequency, grid, np.concatenate([[0.0], excitation_phase]))
    magnitude = np.sqrt(np.maximum(damping, 0.0) * omega / (np.pi * radius * DENSITY * GRAVITY**2))
    begin, end = TAPER_BAND
    taper_position = np.clip((frequency - begin) / (end - begin), 0.0, 1.0)
    kr = omega**2 / GRAVITY * radius  # k r
    phase = kr - 1.0 / (8.0 * kr + 4.0 / np.pi) + phase_lead + 0.75 * np.pi
    wave: Complexes = magnitude * (0.5 + 0.5 * np.cos(np.pi * taper_position)) * np.exp(1j * phase)
    return wave


def radiation_filter(bem: Bem, radius: Metre) -> Floats:
    """Return the causal filter from heave velocity to radiated elevation, one tap per 0.1 s.

    The filter is a least-squares fit over 0.15-1.25 Hz, weighted relative to the target magnitude,
    and loosely to zero elsewhere. The far field alone is not quite causal: an error of 1.0 %
    remains at 3 m and 0.6 % at 5 m over 0.2-1.2 Hz.
    """
    key = (bem.frequency.tobytes(), bem.damping.tobytes(), bem.excitation.tobytes())
    return _compute_filter(*key, radius).copy()


@lru_cache(maxsize=16)  # worlds in one process mostly share hull and probes
def _compute_filter(frequencies: bytes, damping: bytes, excitation: bytes, radius: Metre) -> Floats:
    empty = np.empty(0)
    bem = Bem(
        np.frombuffer(frequencies),
        empty,
        np.frombuffer(damping),
        np.frombuffer(excitation, complex),
        0.0,
        0.0,
        math.inf,
    )
    step = TAP_SPACING / SAMPLE_RATE
    longest_delay = 2.0 * 2.0 * math.pi * 1.3 * radius / GRAVITY  # r/c_g at 1.3 Hz
    count = math.ceil((longest_delay + 6.0) / step)
    frequency = np.linspace(0.0, 0.5 / step, 601)
    target_response = np.conj(
        radiated_wave(bem, radius, frequency)
    )  # e^{+i omega t}: a delay is e^{-i omega t}
    magnitude = np.abs(target_response)
    peak = float(magnitude.max())
    in_band = (frequency >= 0.15) & (frequency <= 1.25)
    weight = np.where(in_band, 1.0 / np.maximum(magnitude, 0.1 * peak), 0.03 / peak)
    basis = np.exp(-2j * np.pi * step * np.outer(frequency, np.arange(count))) * weight[:, None]
    matrix = np.vstack([basis.real, basis.imag])
    right_side = np.concatenate([(target_response * weight).real, (target_response * weight).imag])
    normal = matrix.T @ matrix
    normal += 1.0e-6 * np.trace(normal) / count * np.eye(count)
    return np.linalg.solve(normal, matrix.T @ right_side)


class Basin:
    """The probes of one basin, sampled at 50 Hz from the wave clock and the hull's velocity."""

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
        """Raise ValueError for a probe nearer than `MIN_PROBE_DISTANCE` to an installed device."""
        radii = [math.sqrt(p.x * p.x + p.y * p.y) for p in probes]
        if device and min(radii) < MIN_PROBE_DISTANCE:
            raise ValueError(
                f"a probe must be {MIN_PROBE_DISTANCE} m or more from the hull's axis, "
                f"got {min(radii):g} m"
            )
        self._incident = np.column_stack([elevation_at(sea, p.x, dt) for p in probes])
        self._period_ticks = len(self._incident)
        self._channel = channel
        self._normals = normals
        filters = [radiation_filter(bem, radius) for radius in radii] if device else []
        longest = max([len(taps) for taps in filters], default=0)
        self._filters = np.array([np.pad(taps, (0, longest - len(taps))) for taps in filters])
        self._tap_count = longest
        # Velocities, newest first, one row per phase of TAP_SPACING; each is stored twice so that
        # every window is contiguous.
        self._velocity_history = np.zeros((TAP_SPACING, 2 * longest))
        self._sample_count = 0

    def sample(self, wave_tick: int, onset: float, velocity: MetrePerSecond) -> list[Metre]:
        """Return the reading of every probe and store the hull's velocity (m/s).

        `wave_tick` counts ticks of the wave clock, negative while the wave maker is off; `onset` is
        the onset factor, the same everywhere in the basin.
        """
        sample_index = self._sample_count
        self._sample_count = sample_index + 1
        elevations = [0.0] * self._incident.shape[1]
        if wave_tick >= 0:
            elevations = [
                onset * x for x in self._incident[wave_tick % self._period_ticks].tolist()
            ]
        if self._tap_count:
            history = self._velocity_history[sample_index % TAP_SPACING]
            start = self._tap_count - 1 - sample_index // TAP_SPACING % self._tap_count
            history[start] = history[start + self._tap_count] = velocity
            radiated = self._filters.dot(history[start : start + self._tap_count]).tolist()
            elevations = [a + b for a, b in zip(elevations, radiated, strict=True)]
        # Each probe reads the noise table from another start.
        channel, normals = self._channel, self._normals
        return [
            measure(channel, x, sample_index + 9973 * i, normals) for i, x in enumerate(elevations)
        ]
