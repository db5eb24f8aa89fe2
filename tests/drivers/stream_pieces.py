"""Feeding a stream parser in pieces, as a serial port would."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any


def pieces(data: bytes, cuts: Iterable[int]) -> list[bytes]:
    """Return ``data`` cut at the given offsets (modulo its length); pieces may be empty."""
    offsets = sorted(cut % (len(data) + 1) for cut in cuts)
    return [data[a:b] for a, b in zip([0, *offsets], [*offsets, len(data)], strict=True)]


def drain(feed: Callable[..., Any], state: Any, parts: Iterable[bytes]) -> tuple[Any, list[Any]]:
    """Return the state after all pieces, and all messages found."""
    messages: list[Any] = []
    for part in parts:
        state, more = feed(state, part)
        messages += more
    return state, messages
