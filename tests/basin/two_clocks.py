"""A run's clock and a recorder's, made apart from what aligns them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.interop.basin.align import Reference
from rig.interop.basin.recording import Recording
from rig.interop.basin.sync import Edge, computed


class Truth(NamedTuple):
    """What the alignment does not see: run time t = tau + offset + drift tau."""

    rate: float = 50.0  # Hz of the recorder
    length: float = 900.0  # s
    offset: float = -31.7
    drift: float = 20e-6
    snr_db: float = 20.0
    edge: float = 12.3456  # s of run time
    edge_error: float = 0.0  # s by which the recorder sees the trigger late
    slip: float = 0.0  # s of run time that the recorder leaves out
    slip_at: float = 450.0  # s of the recorder

    def run_time(self, tau: np.ndarray) -> np.ndarray:
        slipped = np.where(tau >= self.slip_at, self.slip, 0.0)
        return tau * (1.0 + self.drift) + self.offset + slipped


def drawn(seed: int, **fixed: float) -> Truth:
    """A truth by a seed: offset, drift within 20 ppm and edge are anything."""
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


def recording(truth: Truth, seed: int) -> Recording:
    """What the recorder makes of the trigger, the 1 Hz sine, and a wave."""
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


def reference(truth: Truth) -> Reference:
    """The run's own: a trigger known to a tick of 1 ms, a sine made from its clock."""
    tick = np.ceil(truth.edge * 1e3) * 1e-3
    return Reference(Edge(float(tick), 1e-3 / 12.0**0.5, 1), computed(1.0))
