"""A thread that draws, so that who supervises a run never waits for a terminal or a disk.

A terminal stands still when its user presses Ctrl-S or its network connection hangs, a disk when it
is busy; the supervisor's signs of life must go on meanwhile, and Ctrl-C must be heard.
"""

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Generic, TypeVar

_LAST = 5.0  # s the last drawing may take

T = TypeVar("T")


class Display(Generic[T]):
    """Draws the newest of what it is shown, in a thread of its own; values in between are skipped.

    Leaving the context has the last value drawn, but waits for no terminal that stands still.
    """

    def __init__(self, draw: Callable[[T], None]) -> None:
        self._draw = draw
        self._changed = threading.Condition()
        self._newest: tuple[T, ...] = ()
        self._ended = False
        self._error: BaseException | None = None
        # A daemon: a terminal that stands still for ever must not keep the process.
        self._thread = threading.Thread(target=self._run, name="display", daemon=True)

    def __enter__(self) -> "Display[T]":
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(_LAST)
        if error is None and self._error is not None:
            raise self._error

    def show(self, value: T) -> None:
        """Have a value drawn soon, and return at once; raises what an earlier drawing raised."""
        if self._error is not None:
            raise self._error
        with self._changed:
            self._newest = (value,)
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._newest or self._ended)
                if not self._newest:
                    return
                (value,), self._newest = self._newest, ()
            try:
                self._draw(value)
            except BaseException as error:  # noqa: BLE001  (`show` raises it)
                self._error = error
                return
