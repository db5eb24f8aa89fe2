"""Where a run's record really is: its folder may be deleted, moved or replaced while it is written.

An open descriptor outlives all that. That of the folder says where it went, and a deleted file can
still be read through its own: it is copied to a rescue place and written on there.
"""

import json
import os
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

PROGRESS = "progress.json"  # newest tick while a run goes on
RESCUED = ".rescued"  # behind the run's name
_COPIED = 1 << 22  # bytes at a time


def leads_to(path: Path, fd: int) -> bool:
    """Whether a path still leads to the open file or folder."""
    try:
        return os.path.samestat(os.stat(path), os.fstat(fd))
    except OSError:
        return False


def folder_now(fd: int) -> Path | None:
    """Where the folder behind a descriptor is now; None if it is deleted or out of reach."""
    with suppress(OSError):
        path = Path(os.readlink(f"/proc/self/fd/{fd}"))
        if leads_to(path, fd):
            return path
    return None


def rescue_folders(folder: Path) -> Iterator[Path]:
    """Where to save a run whose folder is lost, the best place first."""
    name = folder.name.removesuffix(RESCUED) + RESCUED
    yield folder.parent / name
    with suppress(RuntimeError):  # a user without a home
        yield Path.home() / name
    yield Path(tempfile.gettempdir()) / name


def rescued(
    folder: Path,
    texts: Mapping[str, bytes],
    files: Mapping[str, int],
    left: Collection[Path] = (),
) -> Path:
    """Save the files of a lost folder in another one; returns that.

    ``texts``: its small files by name; ``files``: descriptors of large ones, copied whole. A rescue
    folder that is there already is used (who saved there saved the same run), but none of ``left``:
    those have failed, and what is in them is out of date. Raises the last place's OSError if all
    places refuse.
    """
    refused: OSError = FileNotFoundError(f"no place to save {folder.name}")
    for place in rescue_folders(folder):
        made: list[Path] = []
        try:
            if place in left or not place.parent.is_dir():
                continue
            place.mkdir(exist_ok=True)
            for name in (*texts, *files):
                if not (place / name).exists():
                    made.append(place / name)
                    if name in texts:
                        (place / name).write_bytes(texts[name])
                    else:
                        copy(files[name], place / name)
        except OSError as error:
            refused = error
            for path in made:
                with suppress(OSError):
                    path.unlink()
            with suppress(OSError):
                place.rmdir()
        else:
            return place
    raise refused


def copy(fd: int, target: Path) -> None:
    """Copy an open file, deleted or not, to a new one; raises OSError."""
    out = os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
    try:
        at = 0
        while data := os.pread(fd, _COPIED, at):
            done = 0
            while done < len(data):
                done += os.pwrite(out, memoryview(data)[done:], at + done)
            at += done
    finally:
        os.close(out)


def held_folder(folder: Path) -> int:
    """A descriptor of a folder, which says where that is whatever becomes of it."""
    return os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)


def note_progress(folder: int, **known: int | str | None) -> None:
    """Note what is known of the ticks so far, for `rig recover` if all are killed.

    ``folder``: a descriptor of it, which leads there wherever it was moved to. ``known``: the
    newest tick as ``last_tick``, the periods ``skipped``; from the loop that has ended
    ``final=True`` and the executed ``ticks``.
    Written in place, a few bytes of one block: it costs no metadata and needs no room on a full
    disk. A failure is nobody's trouble: the record is what counts.
    """
    with suppress(OSError):
        fd = os.open(PROGRESS, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o644, dir_fd=folder)
        try:
            text = json.dumps(known)
            os.pwrite(fd, f"{text:<255}\n".encode(), 0)
        finally:
            os.close(fd)


class Whereabouts:
    """Where a run's folder is, for the process that sees the run to its end.

    It holds the parts of the record open: one that is deleted after its logger has ended is saved
    all the same.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.lost = ""  # what became of the folder, in words; empty: it is where it was made
        self._why = ""
        self.descriptor = held_folder(folder)
        self._texts = {path.name: path.read_bytes() for path in folder.glob("*.json")}
        self._parts: dict[str, int] = {}

    def hold(self, part: str) -> None:
        """Hold a part of the record as soon as it is there."""
        if part not in self._parts:
            with suppress(OSError):
                self._parts[part] = os.open(self.folder / part, os.O_RDONLY | os.O_CLOEXEC)

    def relocate(self, folder: Path, why: str) -> None:
        """The record goes on in another folder."""
        before = self.descriptor  # the display notes progress through it, in a thread of its own
        self.folder, self.descriptor = folder, held_folder(folder)
        os.close(before)
        self._why = self._why or why
        self.lost = f"{self._why} while it was written; the record is in {folder}"
        for part, fd in list(self._parts.items()):  # of a copy the original grows no more
            with suppress(OSError):
                self._parts[part] = os.open(folder / part, os.O_RDONLY | os.O_CLOEXEC)
                os.close(fd)

    def settle(self) -> Path:
        """The folder with all of the record in it, after saving what is not; raises OSError."""
        now = folder_now(self.descriptor)
        if now is None:
            saved = rescued(self.folder, self._texts, self._parts)
            self.relocate(saved, "the run's folder was deleted")
        elif now != self.folder and not leads_to(self.folder, self.descriptor):
            self.relocate(now, "the run's folder was moved")
        for part, fd in self._parts.items():
            if not (self.folder / part).exists():
                copy(fd, self.folder / part)
                self._why = self._why or f"{part} was deleted"
                self.lost = f"{self._why} while it was written; the record is in {self.folder}"
        return self.folder

    def settled(self) -> bool:
        """Whether `settle` found or made a folder that can be written to."""
        try:
            self.settle()
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Let go of everything."""
        before, self.descriptor = self.descriptor, -1
        for fd in (before, *self._parts.values()):
            os.close(fd)
