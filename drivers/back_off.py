"""When something that failed is tried again: after a pause that doubles, up to a longest one."""


class BackOff:
    """The pause before the next attempt; time is an argument."""

    def __init__(self, first: float, most: float) -> None:
        """``first`` and ``most``: shortest and longest pause, s, 0 < first <= most."""
        self._first, self._most = first, most
        self._pause = first
        self._not_before = -1e9  # s, before any clock began

    def ready(self, now: float) -> bool:
        """True when the next attempt may be made."""
        return now >= self._not_before

    def failed(self, now: float) -> None:
        """It failed, or what had worked is lost: wait, and longer each time."""
        self._not_before = now + self._pause
        self._pause = min(2.0 * self._pause, self._most)

    def worked(self) -> None:
        """Something came of it: the next pause is the first one again."""
        self._pause = self._first
