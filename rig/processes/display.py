"""A drawing thread, so that the supervisor of a run never waits for a terminal or a disk.

A terminal blocks when its user presses Ctrl-S or its network connection hangs, a disk when it is
busy. The supervisor must go on sending its heartbeat and reacting to Ctrl-C meanwhile.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

_FINAL_DRAW_TIMEOUT_S = 5.0  # s that the last drawing may take

T = TypeVar("T")


@contextmanager
def drawing_thread(draw: Callable[[T], None]) -> Iterator[Callable[[T], None]]:
    """Draw values in a thread of their own; yield the function that takes the newest value.

    The function returns at once, or raises the error of an earlier drawing; older values that were
    not drawn are skipped. Leaving the context waits until the last value is drawn, but not for a
    terminal that blocks.
    """
    changed = threading.Condition()
    newest: list[T] = []
    errors: list[BaseException] = []
    ended = False

    def run() -> None:
        while True:
            with changed:
                changed.wait_for(lambda: newest or ended)
                if not newest:
                    return
                value = newest.pop()
            try:
                draw(value)
            except BaseException as error:  # noqa: BLE001  (`show` raises it)
                errors.append(error)
                return

    def show(value: T) -> None:
        if errors:
            raise errors[0]
        with changed:
            newest[:] = [value]
            changed.notify()

    # A daemon thread: a terminal that blocks for ever must not keep the process alive.
    thread = threading.Thread(target=run, name="display", daemon=True)
    thread.start()
    try:
        yield show
    finally:
        with changed:
            ended = True
            changed.notify()
        thread.join(_FINAL_DRAW_TIMEOUT_S)
    if errors:
        raise errors[0]
