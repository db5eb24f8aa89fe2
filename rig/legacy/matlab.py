"""Matrices of a MATLAB file, read in a process of their own.

scipy's reader can take the whole interpreter down when a file is damaged (one changed byte in the
type field of an element is a segmentation fault), so it is never let into the caller's process.
"""

import io
import json
import subprocess
import sys
import warnings
from typing import Any, NamedTuple

_SECONDS = 60.0  # for one file

NEWER = "a MATLAB 7.3 file is not read; save it with -v7"


class Variables(NamedTuple):
    """What a file holds."""

    matrices: dict[str, list[list[float]]]  # numeric, two-dimensional, not empty
    texts: dict[str, list[str]]  # cell arrays of text
    names: tuple[str, ...]  # of all variables


def load(data: bytes) -> Variables:
    """The variables of a file; ValueError says why it cannot be read."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__],
            input=data,
            capture_output=True,
            timeout=_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise ValueError("not readable as a MATLAB file: gave up after a minute") from None
    if done.returncode != 0:
        last = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        said = NEWER if last.startswith("NotImplementedError") else last
        if not said or done.returncode < 0:
            said = f"the reader broke down (exit code {done.returncode}); is the file damaged?"
        raise ValueError(said if said == NEWER else f"not readable as a MATLAB file: {said}")
    return Variables(**json.loads(done.stdout))


def _read(data: bytes) -> dict[str, Any]:
    import numpy as np  # noqa: PLC0415 - only the child needs them
    from scipy.io import loadmat  # noqa: PLC0415

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found: dict[str, Any] = loadmat(io.BytesIO(data), mat_dtype=True)
    own = {name: value for name, value in found.items() if not name.startswith("__")}
    arrays = {name: value for name, value in own.items() if isinstance(value, np.ndarray)}
    return {
        "matrices": {
            name: value.astype(float).tolist()
            for name, value in arrays.items()
            if value.ndim == 2 and value.size and value.dtype.kind in "fiu"
        },
        "texts": {
            name: [str(np.asarray(cell).reshape(-1)[0]) for cell in value.reshape(-1) if len(cell)]
            for name, value in arrays.items()
            if value.dtype.kind in "OU"
        },
        "names": tuple(own),
    }


if __name__ == "__main__":
    json.dump(_read(sys.stdin.buffer.read()), sys.stdout)
