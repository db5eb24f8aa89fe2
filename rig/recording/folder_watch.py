"""Location of a run's record, whose folder may be deleted, moved or replaced during the run.

An open descriptor remains valid in all these cases. The folder's descriptor gives its new path. A
deleted file can still be read through its descriptor: it is copied to a rescue folder, and writing
continues there.
"""

import json
import os
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

PROGRESS = "progress.json"  # newest tick of a running run
RESCUE_SUFFIX = ".rescued"  # appended to the run's name
_COPY_BYTES = 1 << 22  # bytes per read


def refers_to(path: Path, fd: int) -> bool:
    """Return whether ``path`` still refers to the open file or folder."""
    try:
        return os.path.samestat(os.stat(path), os.fstat(fd))
    except OSError:
        return False


def current_folder(fd: int) -> Path | None:
    """Return the present path of an open folder; None if it is deleted or unreachable."""
    with suppress(OSError):
        path = Path(os.readlink(f"/proc/self/fd/{fd}"))
        if refers_to(path, fd):
            return path
    return None


def rescue_folders(folder: Path) -> Iterator[Path]:
    """Yield the folders in which a run without its folder can be saved, the best one first."""
    name = folder.name.removesuffix(RESCUE_SUFFIX) + RESCUE_SUFFIX
    yield folder.parent / name
    with suppress(RuntimeError):  # a user without a home
        yield Path.home() / name
    yield Path(tempfile.gettempdir()) / name


def save_to_rescue_folder(
    folder: Path,
    texts: Mapping[str, bytes],
    files: Mapping[str, int],
    excluded: Collection[Path] = (),
) -> Path:
    """Save the files of a lost folder in a rescue folder; return that folder.

    ``texts``: small files by name; ``files``: descriptors of large files, copied whole. A rescue
    folder that exists already is used (it holds the same run), except those in ``excluded``: they
    have failed before, and their content is out of date. Raise the OSError of the last candidate if
    all fail.
    """
    failure: OSError = FileNotFoundError(f"no place to save {folder.name}")
    for place in rescue_folders(folder):
        written: list[Path] = []
        try:
            if place in excluded or not place.parent.is_dir():
                continue
            place.mkdir(exist_ok=True)
            for name in (*texts, *files):
                if not (place / name).exists():
                    written.append(place / name)
                    if name in texts:
                        (place / name).write_bytes(texts[name])
                    else:
                        copy(files[name], place / name)
        except OSError as error:
            failure = error
            for path in written:
                with suppress(OSError):
                    path.unlink()
            with suppress(OSError):
                place.rmdir()
        else:
            return place
    raise failure


def copy(fd: int, target: Path) -> None:
    """Copy an open file, deleted or not, to a new file; raise OSError."""
    target_fd = os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
    try:
        offset = 0
        while data := os.pread(fd, _COPY_BYTES, offset):
            done = 0
            while done < len(data):
                done += os.pwrite(target_fd, memoryview(data)[done:], offset + done)
            offset += done
    finally:
        os.close(target_fd)


def open_folder(folder: Path) -> int:
    """Return a descriptor of a folder; it stays valid wherever the folder is moved."""
    return os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)


def write_progress(folder: int, **values: int | str | None) -> None:
    """Write the newest tick counts, for `rig recover` in case all processes are killed.

    ``folder``: descriptor of the run's folder, valid wherever it is moved. ``values``: the newest
    tick as ``last_tick``, the periods ``skipped``; from a loop that has ended ``final=True`` and
    the executed ``ticks``.
    The file is overwritten in place, a few bytes of one block: this costs no metadata update and
    works on a full disk. An OSError is ignored, because the record itself matters more.
    """
    with suppress(OSError):
        fd = os.open(PROGRESS, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o644, dir_fd=folder)
        try:
            text = json.dumps(values)
            os.pwrite(fd, f"{text:<255}\n".encode(), 0)
        finally:
            os.close(fd)


class FolderTracker:
    """Tracks a run's folder for the process that supervises the run to its end.

    It keeps the parts of the record open, so that it can save a part that is deleted after its
    logger has ended.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.problem = ""  # what happened to the folder; empty while it is in its first place
        self._cause = ""
        self.descriptor = open_folder(folder)
        self._texts = {path.name: path.read_bytes() for path in folder.glob("*.json")}
        self._parts: dict[str, int] = {}
        for record in folder.glob("earlier-*"):  # of a resumed run
            self.open_part(record.name)

    def open_part(self, part: str) -> None:
        """Open a part of the record if it exists."""
        if part not in self._parts:
            with suppress(OSError):
                self._parts[part] = os.open(self.folder / part, os.O_RDONLY | os.O_CLOEXEC)

    def relocate(self, folder: Path, cause: str) -> None:
        """Continue the record in another folder."""
        before = self.descriptor  # the display writes progress through it, in its own thread
        self.folder, self.descriptor = folder, open_folder(folder)
        os.close(before)
        self._cause = self._cause or cause
        self.problem = f"{self._cause} while it was written; the record is in {folder}"
        for part, fd in list(self._parts.items()):  # the original of a copy no longer grows
            with suppress(OSError):
                self._parts[part] = os.open(folder / part, os.O_RDONLY | os.O_CLOEXEC)
                os.close(fd)

    def locate_record(self) -> Path:
        """Return the folder with the whole record, after saving missing files; raise OSError."""
        now = current_folder(self.descriptor)
        if now is None:
            saved = save_to_rescue_folder(self.folder, self._texts, self._parts)
            self.relocate(saved, "the run's folder was deleted")
        elif now != self.folder and not refers_to(self.folder, self.descriptor):
            self.relocate(now, "the run's folder was moved")
        for part, fd in self._parts.items():
            if not (self.folder / part).exists():
                copy(fd, self.folder / part)
                self._cause = self._cause or f"{part} was deleted"
                self.problem = f"{self._cause} while it was written; the record is in {self.folder}"
        return self.folder

    def can_locate_record(self) -> bool:
        """Return whether `locate_record` found or created a writable folder."""
        try:
            self.locate_record()
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Close all descriptors."""
        before, self.descriptor = self.descriptor, -1
        for fd in (before, *self._parts.values()):
            os.close(fd)
