"""The golden run of the modular kind: heave and a rotating pitch axis, a tared sensor with noise.

After an intended change, this program stores it again, from the root of the tree:

    PYTHONPATH=.:tests:tests/modes:tests/modular:tests/rehearsal:tests/batch \\
        python tests/batch/golden_modular.py
"""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path

from modular_rigs import (
    FORCE,
    HEAVE,
    HEAVE_LIMITS,
    PITCH,
    PITCH_LIMITS,
    PLANT_SENSORS,
    POWER,
    limits_mapping,
    plant_mapping,
    rig_mapping,
    write_campaign,
)
from rig_command import rig_here

RECORD = Path(__file__).resolve().parent / "golden" / "modular.mcap"
GAINS = (
    {"heave_kp_n_s_per_m": -3000, "heave_ki_n_per_m": 2000,
     "pitch_kp_n_m_s_per_rad": -300, "pitch_ki_n_m_per_rad": 0},
    {"heave_kp_n_s_per_m": -5000, "heave_ki_n_per_m": 0,
     "pitch_kp_n_m_s_per_rad": -500, "pitch_ki_n_m_per_rad": 100},
)  # fmt: skip


def make_campaign(folder: Path) -> Path:
    """Write the campaign with its files: two rows of one period after a short lead-in."""
    rig = rig_mapping(
        axes={"heave": HEAVE | {"gain_ramp_s": 0.1}, "pitch": PITCH},
        sensors={"pto_force": FORCE | {"scale": 1.5, "offset": -7.0}, "dc_power": POWER},
        stop={"duration_s": 0.3, "ramp_s": 0.1},
    )
    sensors = PLANT_SENSORS | {"pto_force": {"signal": "heave.force", "noise": 2.0, "offset": 4.0}}
    return write_campaign(
        folder,
        rig,
        limits_mapping(heave=HEAVE_LIMITS, pitch=PITCH_LIMITS),
        plant_mapping(sensors=sensors, wave_onset_s=0.5),
        sea={"kind": "regular", "amplitude_m": 0.3, "frequency_hz": 0.8},
        tare={"duration_s": 0.5},
        start={"lead_in_s": 0.5},
        timing={"settle_s": 0.1, "interval_s": 1.4},
        matrix={"list": list(GAINS)},
    )


def store_run() -> None:
    """Rehearse the campaign and store its log."""
    with tempfile.TemporaryDirectory() as scratch:
        campaign = make_campaign(Path(scratch))
        _, out, err = rig_here("run", campaign, "--runs", scratch, "--json")
        report = json.loads(out)
        assert report["status"] == "complete", err or out
        shutil.copy(Path(report["folder"]) / "run.mcap", RECORD)


if __name__ == "__main__":
    store_run()
    print(RECORD, RECORD.stat().st_size, "bytes")
