"""The I/O process that converses with one device of its own wire and posts its last message.

When the device falls silent, its values age and the loop stops for that; this process reports why.
"""

import time
from collections.abc import Callable
from contextlib import closing

from drivers.conversation import Exchange
from rig.processes.io_process import end_condition, run_io_process
from rig.processes.mailbox import Mailbox
from rig.processes.messages import IoJob, Notice, Ready, Refused, report
from rig.wires.messages import open_mailboxes
from rig.wires.streams import Stream, create_stream

PAUSE_S = 0.0004  # s between two turns on the line
MAX_READY_AGE_S = 0.5  # s, age of a first message that makes the device ready
READY_TIMEOUT_S = 5.0  # s until the device must be ready
RELEASE_S = 0.3  # s in which the last command goes out
_REPORT_INTERVAL_S = 5.0  # s between two messages about an intermittent problem

EndCondition = Callable[[], bool]


def converse(job: IoJob) -> None:
    """Serve one device until terminated or until the loop has ended."""
    config, slots = job.config, open_mailboxes(job.mailboxes)
    stream = create_stream(config["kind"], config["settings"], slots)
    stream.link.open()
    ended = end_condition(job.lifeline)
    exchange, slot = Exchange(stream.link, stream.conversation), slots[config["name"]]
    with closing(stream.link):
        if _wait_until_ready(stream, exchange, slot, ended):
            _serve(stream, exchange, slot, ended)
        _release(stream, exchange)


def _wait_until_ready(
    stream: Stream, exchange: Exchange, slot: Mailbox, ended: EndCondition
) -> bool:
    """Converse until the device has sent a message; False after the time-out or at the end."""
    until = time.monotonic() + READY_TIMEOUT_S
    while not ended():
        now = exchange.step()
        message = stream.read_message(now)
        if message is not None and now - message.stamp < MAX_READY_AGE_S:
            slot.post(message)
            report(Ready())
            return True
        if now > until:
            problem = stream.conversation.explain(now) or stream.link.problem
            report(Refused(f"{stream.link.name}: {problem}"))
            return False
        time.sleep(PAUSE_S)
    return False


def _serve(stream: Stream, exchange: Exchange, slot: Mailbox, ended: EndCondition) -> None:
    last_report, last_problem = -_REPORT_INTERVAL_S, ""
    while not ended():
        stream.forward_command(time.monotonic())
        now = exchange.step()
        message = stream.read_message(now)
        if message is not None:
            slot.post(message)
        problem = stream.link.problem or stream.conversation.explain(now)
        if problem != last_problem and (not problem or now - last_report >= _REPORT_INTERVAL_S):
            report(Notice(problem or "the device works again"))
            last_report, last_problem = now, problem
        time.sleep(PAUSE_S)


def _release(stream: Stream, exchange: Exchange) -> None:
    """Send the device the commands that release it before the line is closed."""
    until = time.monotonic() + RELEASE_S
    while (now := exchange.step()) < until and stream.link.is_open:
        stream.release(now)
        time.sleep(PAUSE_S)


if __name__ == "__main__":
    run_io_process(converse)
