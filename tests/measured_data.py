"""Measured data that may not be redistributed: where they are looked for, and tests without them.

They lie in a folder of their own: the one that WEC_RIG_DATA names, or else `../shared/data` beside
the repository. README says what they are and where they come from.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

VARIABLE = "WEC_RIG_DATA"
WHAT = {  # from the public repository sandialabs/fbWecCntrl, GPL-3
    "MASK4_testlog.xlsx": "test log of MASK4",
    "AWDC-SAADAQ-s00113.twe": "wave record of the empty basin, 2019",
    "mask4_impedance_20A_m9228_0p2_1Hz.csv": "impedance identified in MASK4, from Zikn12.mat",
}


def folder() -> Path:
    """Where measured data are looked for."""
    given = os.environ.get(VARIABLE)
    return Path(given) if given else Path(__file__).resolve().parents[2] / "shared" / "data"


def missing(name: str) -> str:
    """Why a test that needs this file cannot be run."""
    what = WHAT.get(name, "measured data")
    return f"no {name} ({what}) in {folder()}: set {VARIABLE} to the folder that holds it"


def reference(name: str) -> Path:
    """A file of measured data; where it is absent the test is skipped."""
    path = folder() / name
    if not path.exists():
        pytest.skip(missing(name))
    return path


def needs(name: str) -> pytest.MarkDecorator:
    """Skips a test, or all of a module as its `pytestmark`, where this file is absent."""
    return pytest.mark.skipif(not (folder() / name).exists(), reason=missing(name))
