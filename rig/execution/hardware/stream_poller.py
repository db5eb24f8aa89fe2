"""One device of the bench kept in conversation beside the loop; its last word lies in a mailbox.

Its values age when it falls silent, and the loop stops for that; what is wrong is said here.
"""

import time
from collections.abc import Callable
from typing import Any

from drivers.conversation import Exchange
from drivers.errors import CodecError, LinkError
from rig.execution.hardware.messages import SLOTS
from rig.execution.hardware.streams import Stream, made
from rig.processes.io_process import report, run, until_ended
from rig.processes.mailbox import Mailbox
from rig.realtime import scheduling

PAUSE = 0.0004  # s between two looks at the line
YOUNG = 0.5  # s: a device that has said something so lately is there
READY = 5.0  # s in which it must be
LEAVE = 0.3  # s in which the last word goes out
_TELL = 5.0  # s between two lines about a trouble that comes and goes

Ended = Callable[[], bool]


def converse(job: dict[str, Any]) -> None:
    """Serve one device until terminated, or until the loop has ended."""
    config = job["config"]
    slots = {name: Mailbox(fd, SLOTS[name]) for name, fd in job["mailboxes"].items()}
    try:
        stream = made(config["kind"], config["told"], slots)
        stream.link.open()
    except (CodecError, LinkError) as error:
        report(event="refused", why=str(error))
        return
    if refused := scheduling.acquire_for_io():
        report(event="say", text=f"no priority over other work: {refused}")
    ended = until_ended(job["lifeline"])
    exchange, slot = Exchange(stream.link, stream.talk), slots[config["kind"]]
    try:
        if _until_there(stream, exchange, slot, ended):
            _serve(stream, exchange, slot, ended)
        _leave(stream, exchange)
    finally:
        stream.link.close()


def _until_there(stream: Stream, exchange: Exchange, slot: Mailbox, ended: Ended) -> bool:
    """Converse until the device has said something; False if it does not, or if it is time."""
    until = time.monotonic() + READY
    while not ended():
        now = exchange.turn()
        word = stream.tell(now)
        if word is not None and now - word.stamp < YOUNG:
            slot.post(word)
            report(event="ready")
            return True
        if now > until:
            said = stream.talk.explain(now) or stream.link.trouble
            report(event="refused", why=f"{stream.link.name}: {said}")
            return False
        time.sleep(PAUSE)
    return False


def _serve(stream: Stream, exchange: Exchange, slot: Mailbox, ended: Ended) -> None:
    told, trouble = -_TELL, ""
    while not ended():
        stream.hear(time.monotonic())
        now = exchange.turn()
        word = stream.tell(now)
        if word is not None:
            slot.post(word)
        said = stream.link.trouble or stream.talk.explain(now)
        if said != trouble and (not said or now - told >= _TELL):
            report(event="say", text=said or "all is well again")
            told, trouble = now, said
        time.sleep(PAUSE)


def _leave(stream: Stream, exchange: Exchange) -> None:
    """The device is let go, as far as a word can do it."""
    until = time.monotonic() + LEAVE
    while (now := exchange.turn()) < until and stream.link.is_open:
        stream.leave(now)
        time.sleep(PAUSE)


if __name__ == "__main__":
    run(converse)
