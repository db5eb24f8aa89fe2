"""Matrices, or the signals of a structure, of a MATLAB file, read in a process of their own.

scipy's reader can take the whole interpreter down when a file is damaged (one changed byte in the
type field of an element is a segmentation fault), so it is never let into the caller's process.
"""

import io
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rig.regular_file import MAX_RECORD_BYTES, open_regular

if TYPE_CHECKING:
    import numpy.typing as npt

_SECONDS = 60.0  # for a file of matrices
_MINUTES = 10  # for one of signals, which may be of hours
_SIGNALS = "signals"

NEWER = "a MATLAB 7.3 file is not read; save it with -v7"


class Variables(NamedTuple):
    """What a file holds."""

    matrices: dict[str, list[list[float]]]  # numeric, two-dimensional, not empty
    texts: dict[str, list[str]]  # cell arrays of text
    names: tuple[str, ...]  # of all variables


def load(data: bytes) -> Variables:
    """The variables of a file; ValueError says why it cannot be read."""
    return Variables(**json.loads(_apart([], data, _SECONDS)))


def signals(path: Path) -> "dict[str, npt.NDArray[Any]]":
    """All numeric vectors of a file's structures, one-dimensional, by dotted path.

    MATLAB 5 and 7.3. The name of a structure that is alone in the file is left out, as MATLAB's
    importdata does. ValueError says why the file cannot be read, OSError if it is not there.
    """
    import numpy as np  # noqa: PLC0415 - tables of text need none

    with open_regular(path, MAX_RECORD_BYTES) as file:  # the child has this very file
        made = _apart([_SIGNALS, f"/proc/{os.getpid()}/fd/{file.fileno()}"], b"", 60.0 * _MINUTES)
    with np.load(io.BytesIO(made), allow_pickle=False) as found:
        return {str(name): found[name] for name in found.files}


def _apart(words: list[str], data: bytes, seconds: float) -> bytes:
    """What this module, as a process of its own, says of a file."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__, *words],
            input=data,
            capture_output=True,
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        waited = "a minute" if seconds < 61.0 else f"{_MINUTES} minutes"
        raise ValueError(f"not readable as a MATLAB file: gave up after {waited}") from None
    if done.returncode != 0:
        last = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        said = NEWER if last.startswith("NotImplementedError") else last
        if not said or done.returncode < 0:
            said = f"the reader broke down (exit code {done.returncode}); is the file damaged?"
        raise ValueError(said if said == NEWER else f"not readable as a MATLAB file: {said}")
    return done.stdout


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


def _read_signals(path: str) -> bytes:
    import numpy as np  # noqa: PLC0415 - only the child needs it

    whole = _variables(path)
    alone = len(whole) == 1 and _members(next(iter(whole.values()))) is not None
    found: dict[str, Any] = {}
    waiting = [("" if alone else name, value) for name, value in whole.items()]
    while waiting:
        name, value = waiting.pop()
        members = _members(value)
        if members is not None:
            inside = ((f"{name}.{part}" if name else part, one) for part, one in members.items())
            waiting.extend(inside)
            continue
        vector = np.asarray(value)
        if vector.dtype.kind in "fiub" and vector.size and vector.size == max(vector.shape):
            found[name] = vector.reshape(-1)
    packed = io.BytesIO()
    np.savez(packed, **found)
    return packed.getvalue()


def _variables(path: str) -> dict[str, Any]:
    """What stands at the top of a file, of either format."""
    import h5py  # noqa: PLC0415 - only the child needs them
    from scipy.io import loadmat  # noqa: PLC0415

    with Path(path).open("rb") as file:
        newer = b"MATLAB 7.3" in file.read(128)
    if newer:
        return {name: one for name, one in h5py.File(path).items() if not name.startswith("#")}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        whole: dict[str, Any] = loadmat(path, mat_dtype=True)
    return {name: one for name, one in whole.items() if not name.startswith("__")}


def _members(value: Any) -> dict[str, Any] | None:
    """The fields of a structure; None for anything else."""
    names = getattr(getattr(value, "dtype", None), "names", None)
    if names:
        return {name: value.reshape(-1)[0][name] for name in names} if value.size == 1 else None
    return dict(value.items()) if hasattr(value, "items") else None


if __name__ == "__main__":
    if _SIGNALS in sys.argv[1:2]:
        sys.stdout.buffer.write(_read_signals(sys.argv[2]))
    else:
        json.dump(_read(sys.stdin.buffer.read()), sys.stdout)
