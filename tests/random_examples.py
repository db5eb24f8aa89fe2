"""The number of random examples of a property's test."""

from __future__ import annotations

from hypothesis import settings

_ALL = 100  # of a test that states no number, in the profile `all`


def examples(number: int) -> int:
    """Return how many of a test's examples a run takes: all, or the share of a part of the tests.

    ``number``: those of `make test-long`. The test command takes fewer (tests/conftest.py): each
    run draws others, and a failing example is stored and tried first from then on.
    """
    return max(5, number * settings.default.max_examples // _ALL)
