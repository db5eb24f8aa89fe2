"""Synthetic records of a run's and a recorder's clock, independent of the alignment code."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.interop.basin.align import Edge, SyncReference, ideal_sine
from rig.recording.channel_file import Recording


class Truth(NamedTuple):
    """True parameters of a recorder's clock: run time t = tau + offset + drift tau."""

    rate: float = 50.0  # Hz of the recorder
    length: float = 900.0  # s
    offset: float = -31.7
    drift: float = 20e-6
    snr_db: float = 20.0
    edge: float = 12.3456  # s of run time
    edge_error: float = 0.0  # s, delay of the trigger in the record
    slip: float = 0.0  # s of run time, skipped by the recorder
    slip_at: float = 450.0  # s of the recorder

    def run_time(self, tau: np.ndarray) -> np.ndarray:
        slipped = np.where(tau >= self.slip_at, self.slip, 0.0)
        return tau * (1.0 + self.drift) + self.offset + slipped


def draw_truth(seed: int, **fixed: float) -> Truth:
    """Draw a truth from a seed: offset, drift of +-20 ppm and edge are random."""
    random = np.random.default_rng(seed)
    return (
        Truth()
        ._replace(
            offset=random.uniform(-40.0, -20.0),
            drift=random.choice([-1.0, 1.0]) * 20e-6,
            edge=random.uniform(5.0, 200.0),
        )
        ._replace(**fixed)
    )


def make_recording(truth: Truth, seed: int) -> Recording:
    """Return the record of the trigger, the 1 Hz sine, and a wave."""
    random = np.random.default_rng([seed, 7])
    tau = np.arange(round(truth.length * truth.rate)) / truth.rate
    t = truth.run_time(tau)
    noise = 2.0 * np.sqrt(0.5 / 10.0 ** (truth.snr_db / 10.0))
    sine = 1.3 + 2.0 * np.sin(2.0 * np.pi * t) + noise * random.normal(size=tau.size)
    ttl = np.where(t >= truth.edge + truth.edge_error, 4.8, 0.1) + 0.05 * random.normal(
        size=tau.size
    )
    wave = 0.1 * np.sin(2.0 * np.pi * 0.4 * t)
    channels = {"TTLTrigger": ttl, "SINESIGNAL": sine, "wave": wave}
    return Recording(Path("x.twe"), tau, channels, np.arange(tau.size))


def make_reference(truth: Truth) -> SyncReference:
    """Return the run's signals: a trigger resolved to 1 ms, a sine generated from its clock."""
    tick = np.ceil(truth.edge * 1e3) * 1e-3
    return SyncReference(Edge(float(tick), 1e-3 / 12.0**0.5, 1), ideal_sine(1.0))
