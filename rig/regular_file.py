"""Opening files that people name: regular ones only, and none larger than what is expected there.

A FIFO would wait for ever, a device gives bytes without end, and to open a serial port moves its
lines. So a path is first opened without touching what it names (O_PATH), looked at, and then opened
through that descriptor: nobody can change it in between.
"""

import os
import stat
from errno import EFBIG, EINVAL, EISDIR
from pathlib import Path
from typing import BinaryIO

MB = 1_000_000
CONFIG_MOST = 4 * MB
"""Most bytes of a YAML file or gain matrix; 100,000 keys and values need half of it."""
TABLE_MOST = 64 * MB
"""Most bytes of a spreadsheet, or of a table of coefficients."""
RECORD_MOST = 512 * MB
"""Most bytes of a basin's record or MATLAB file: eight hours of 20 channels at 50 Hz as text."""

_KINDS = (
    (stat.S_ISFIFO, "it is a FIFO (named pipe)"),
    (stat.S_ISSOCK, "it is a socket"),
    (stat.S_ISCHR, "it is a device"),
    (stat.S_ISBLK, "it is a device"),
)


def open_regular(path: Path, most: int | None = None) -> BinaryIO:
    """The file, open for reading; links are followed.

    OSError unless it is a regular file of at most ``most`` bytes (None: of any size), with what it
    is instead as its text.
    """
    try:
        seen = os.open(path, os.O_PATH | os.O_CLOEXEC)
        try:
            status = os.fstat(seen)
            _admit(path, status, most)
            # non-blocking: some files in /proc call themselves regular and wait all the same
            flags = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC
            return open(os.open(f"/proc/self/fd/{seen}", flags), "rb")
        finally:
            os.close(seen)
    except OSError as error:
        error.filename = str(path)
        raise


def read_regular(path: Path, most: int) -> bytes:
    """All bytes of a file that `open_regular` admits; OSError also if it grows beyond ``most``."""
    with open_regular(path, most) as file:
        data = file.read(most + 1) or b""
    if len(data) > most:
        raise _too_large(path, len(data), most)
    return data


def _admit(path: Path, status: os.stat_result, most: int | None) -> None:
    mode = status.st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(EISDIR, f"{os.strerror(EISDIR)}; allowed a regular file", str(path))
    if not stat.S_ISREG(mode):
        what = next((words for of_kind, words in _KINDS if of_kind(mode)), "it is something else")
        raise OSError(EINVAL, f"{what}; allowed a regular file", str(path))
    if most is not None and status.st_size > most:
        raise _too_large(path, status.st_size, most)


def _too_large(path: Path, size: int, most: int) -> OSError:
    text = f"it has {size / MB:.3g} MB or more; allowed at most {most / MB:g} MB"
    return OSError(EFBIG, text, str(path))
