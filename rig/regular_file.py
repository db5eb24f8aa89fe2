"""Opening of files that a user names: regular files only, up to a maximum size; and new ones.

Reading a FIFO blocks for ever, a device delivers bytes without end, and opening a serial port
changes its control lines. A path is therefore first opened with O_PATH, which does not touch the
file itself, then checked, and then opened through that descriptor, so that the file cannot be
exchanged in between.
"""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import EFBIG, EINVAL, EIO, EISDIR
from pathlib import Path
from typing import BinaryIO

MB = 1_000_000
MAX_CONFIG_BYTES = 4 * MB
"""Maximum size of a YAML file or gain matrix; 100,000 keys and values need half of it."""
MAX_TABLE_BYTES = 64 * MB
"""Maximum size of a spreadsheet or of a table of coefficients."""
MAX_RECORD_BYTES = 512 * MB
"""Maximum size of a basin recording or MATLAB file: 8 h of 20 channels at 50 Hz as text."""

_KINDS = (
    (stat.S_ISFIFO, "it is a FIFO (named pipe)"),
    (stat.S_ISSOCK, "it is a socket"),
    (stat.S_ISCHR, "it is a device"),
    (stat.S_ISBLK, "it is a device"),
)


def open_regular(path: Path, max_bytes: int | None = None) -> BinaryIO:
    """Return a regular file open for reading in binary mode; symbolic links are followed.

    Raises OSError if the path is not a regular file of at most ``max_bytes`` bytes (None: any
    size); the error text names what the path is instead.
    """
    try:
        path_fd = os.open(path, os.O_PATH | os.O_CLOEXEC)
        try:
            _check_regular(path, os.fstat(path_fd), max_bytes)
            # Non-blocking: some files in /proc are marked as regular but block on open.
            flags = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC
            return open(os.open(f"/proc/self/fd/{path_fd}", flags), "rb")
        finally:
            os.close(path_fd)
    except OSError as error:
        error.filename = str(path)
        raise


def read_regular(path: Path, max_bytes: int) -> bytes:
    """Return all bytes of a regular file.

    Raises OSError as `open_regular` does, and also if the file grows beyond ``max_bytes``.
    """
    with open_regular(path, max_bytes) as file:
        data = file.read(max_bytes + 1) or b""
    if len(data) > max_bytes:
        raise _too_large(path, len(data), max_bytes)
    return data


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the path of a new file that replaces ``path`` at the end of the context.

    A reader finds the old file or the new one, never a part of it. After an error the old file
    remains, and no partial one. A device or a pipe is written itself. An OSError names ``path``.
    """
    target = path.resolve()
    if target.exists() and not target.is_file():
        yield path
        return
    part = target.with_name(f".{target.name}.new")
    try:
        yield part
        part.replace(target)
    except BaseException as error:
        with suppress(OSError):
            part.unlink()
        if not isinstance(error, OSError):
            raise
        number = error.errno or EIO
        raise OSError(number, os.strerror(number), str(path)) from error


def _check_regular(path: Path, status: os.stat_result, max_bytes: int | None) -> None:
    mode = status.st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(EISDIR, f"{os.strerror(EISDIR)}; allowed a regular file", str(path))
    if not stat.S_ISREG(mode):
        reason = next((text for is_kind, text in _KINDS if is_kind(mode)), "it is not a file")
        raise OSError(EINVAL, f"{reason}; allowed a regular file", str(path))
    if max_bytes is not None and status.st_size > max_bytes:
        raise _too_large(path, status.st_size, max_bytes)


def _too_large(path: Path, size: int, max_bytes: int) -> OSError:
    text = f"it has {size / MB:.3g} MB or more; allowed at most {max_bytes / MB:g} MB"
    return OSError(EFBIG, text, str(path))
