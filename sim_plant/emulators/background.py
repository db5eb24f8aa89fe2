"""A background task that runs as long as its emulator."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Coroutine
from typing import Any


class BackgroundTask:
    """One task; its failure is reported to the loop's exception handler at once."""

    def __init__(self) -> None:
        """Create the object without a running task."""
        self._task: asyncio.Task[None] | None = None

    def start(self, coroutine: Coroutine[Any, Any, None]) -> None:
        """Start the task; a task that is already running is cancelled."""
        if self._task is not None:
            self._task.cancel()
        self._task = asyncio.create_task(coroutine)
        self._task.add_done_callback(_report_failure)

    async def stop(self) -> None:
        """Cancel the task and wait until it has ended."""
        task, self._task = self._task, None
        if task is not None:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):  # reported already
                await task


def _report_failure(task: asyncio.Task[None]) -> None:
    if not task.cancelled() and (failure := task.exception()) is not None:
        context = {"message": "an emulator's task failed", "exception": failure, "task": task}
        task.get_loop().call_exception_handler(context)
