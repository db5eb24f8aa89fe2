"""Read matrices, or the signals of a structure, from a MATLAB file in a separate process.

scipy's reader can crash the interpreter on a damaged file (one changed byte in the type field of an
element is a segmentation fault), so it never runs in the caller's process.
"""

import io
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rig.module_process import module_command
from rig.regular_file import MAX_RECORD_BYTES, open_regular

if TYPE_CHECKING:
    import numpy.typing as npt

_TIMEOUT_S = 60.0  # s, for a file of matrices
_SIGNALS_TIMEOUT_MIN = 10  # min, for a file of signals, which may cover hours
_SIGNALS = "signals"

VERSION_7_3 = "a MATLAB 7.3 file is not read; save it with -v7"


class MatVariables(NamedTuple):
    """The variables of a file."""

    matrices: dict[str, list[list[float]]]  # numeric, two-dimensional, not empty
    texts: dict[str, list[str]]  # cell arrays of text
    names: tuple[str, ...]  # names of all variables


def load_variables(data: bytes) -> MatVariables:
    """Return the variables of a file; raise ValueError with the reason if it cannot be read."""
    return MatVariables(**json.loads(_run_reader([], data, _TIMEOUT_S)))


def load_signals(path: Path) -> "dict[str, npt.NDArray[Any]]":
    """Return all numeric vectors of a file's structures, one-dimensional, by dotted path.

    The file may be MATLAB 5 or 7.3. The name of a file's only structure is left out, as MATLAB's
    importdata does. Raises ValueError with the reason if the file cannot be read, OSError if it
    does not exist.
    """
    import numpy as np  # noqa: PLC0415 - tables of text do not need it

    with open_regular(path, MAX_RECORD_BYTES) as file:  # the child opens the same file
        packed = _run_reader(
            [_SIGNALS, f"/proc/{os.getpid()}/fd/{file.fileno()}"], b"", 60.0 * _SIGNALS_TIMEOUT_MIN
        )
    with np.load(io.BytesIO(packed), allow_pickle=False) as arrays:
        return {str(name): arrays[name] for name in arrays.files}


def _run_reader(arguments: list[str], data: bytes, seconds: float) -> bytes:
    """Run this module as a process on a file and return its standard output."""
    try:
        process = subprocess.run(
            module_command(__name__, *arguments),
            input=data,
            capture_output=True,
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        waited = "a minute" if seconds < 61.0 else f"{_SIGNALS_TIMEOUT_MIN} minutes"
        raise ValueError(f"not readable as a MATLAB file: gave up after {waited}") from None
    if process.returncode != 0:
        last = process.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        message = VERSION_7_3 if last.startswith("NotImplementedError") else last
        if not message or process.returncode < 0:
            message = f"the reader crashed (exit code {process.returncode}); is the file damaged?"
        raise ValueError(
            message if message == VERSION_7_3 else f"not readable as a MATLAB file: {message}"
        )
    return process.stdout


def _read_variables(data: bytes) -> dict[str, Any]:
    import numpy as np  # noqa: PLC0415 - only the child needs them
    from scipy.io import loadmat  # noqa: PLC0415

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        loaded: dict[str, Any] = loadmat(io.BytesIO(data), mat_dtype=True)
    own = {name: value for name, value in loaded.items() if not name.startswith("__")}
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

    top_level = _top_level(path)
    single_structure = len(top_level) == 1 and _members(next(iter(top_level.values()))) is not None
    vectors: dict[str, Any] = {}
    pending = [("" if single_structure else name, value) for name, value in top_level.items()]
    while pending:
        name, value = pending.pop()
        members = _members(value)
        if members is not None:
            inside = ((f"{name}.{part}" if name else part, one) for part, one in members.items())
            pending.extend(inside)
            continue
        vector = np.asarray(value)
        if vector.dtype.kind in "fiub" and vector.size and vector.size == max(vector.shape):
            vectors[name] = vector.reshape(-1)
    packed = io.BytesIO()
    np.savez(packed, **vectors)
    return packed.getvalue()


def _top_level(path: str) -> dict[str, Any]:
    """Return the top-level variables of a file of either format."""
    import h5py  # noqa: PLC0415 - only the child needs them
    from scipy.io import loadmat  # noqa: PLC0415

    with Path(path).open("rb") as file:
        newer = b"MATLAB 7.3" in file.read(128)
    if newer:
        return {name: one for name, one in h5py.File(path).items() if not name.startswith("#")}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        loaded: dict[str, Any] = loadmat(path, mat_dtype=True)
    return {name: one for name, one in loaded.items() if not name.startswith("__")}


def _members(value: Any) -> dict[str, Any] | None:
    """Return the fields of a structure; None for anything else."""
    names = getattr(getattr(value, "dtype", None), "names", None)
    if names:
        return {name: value.reshape(-1)[0][name] for name in names} if value.size == 1 else None
    return dict(value.items()) if hasattr(value, "items") else None


if __name__ == "__main__":
    if _SIGNALS in sys.argv[1:2]:
        sys.stdout.buffer.write(_read_signals(sys.argv[2]))
    else:
        json.dump(_read_variables(sys.stdin.buffer.read()), sys.stdout)
