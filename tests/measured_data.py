"""Find measured data that may not be redistributed; skip tests if they are absent.

The data are in the folder named by WEC_RIG_DATA, by default `../shared/data` next to the
repository. README lists them with their source.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

VARIABLE = "WEC_RIG_DATA"
DESCRIPTIONS = {  # from the public repository sandialabs/fbWecCntrl, GPL-3
    "MASK4_testlog.xlsx": "test log of MASK4",
    "AWDC-SAADAQ-s00113.twe": "wave record of the empty basin, 2019",
    "Zikn12.mat": "intrinsic impedance identified in MASK4",
    "Zidkn12.mat": "impedance with drivetrain identified in MASK4",
    "mask4_impedance_20A_m9228_0p2_1Hz.csv": "impedance identified in MASK4, from Zikn12.mat",
}


def folder() -> Path:
    """Return the folder of measured data."""
    given = os.environ.get(VARIABLE)
    return Path(given) if given else Path(__file__).resolve().parents[2] / "shared" / "data"


def missing(name: str) -> str:
    """Return the reason for skipping a test that needs this file."""
    description = DESCRIPTIONS.get(name, "measured data")
    return f"no {name} ({description}) in {folder()}: set {VARIABLE} to the folder that holds it"


def reference(name: str) -> Path:
    """Return the path of a file of measured data; skip the test if it is absent."""
    path = folder() / name
    if not path.exists():
        pytest.skip(missing(name))
    return path


def needs(name: str) -> pytest.MarkDecorator:
    """Return a mark that skips a test, or a module as its `pytestmark`, if this file is absent."""
    return pytest.mark.skipif(not (folder() / name).exists(), reason=missing(name))
