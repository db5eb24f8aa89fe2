"""A drawing thread, so that the supervisor of a run never waits for a terminal or a disk.

A terminal blocks when its user presses Ctrl-S or its network connection hangs, a disk when it is
busy. The supervisor must go on sending its heartbeat and reacting to Ctrl-C meanwhile.
"""

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Generic, TypeVar

_FINAL_DRAW_TIMEOUT_S = 5.0  # s that the last drawing may take

T = TypeVar("T")


class Display(Generic[T]):
    """Draws the newest value in a thread of its own; older values that were not drawn are skipped.

    Leaving the context waits until the last value is drawn, but not for a terminal that blocks.
    """

    def __init__(self, draw: Callable[[T], None]) -> None:
        self._draw = draw
        self._changed = threading.Condition()
        self._newest: tuple[T, ...] = ()
        self._ended = False
        self._error: BaseException | None = None
        # A daemon thread: a terminal that blocks for ever must not keep the process alive.
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
        self._thread.join(_FINAL_DRAW_TIMEOUT_S)
        if error is None and self._error is not None:
            raise self._error

    def show(self, value: T) -> None:
        """Queue a value for drawing and return at once; raise the error of an earlier drawing."""
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
