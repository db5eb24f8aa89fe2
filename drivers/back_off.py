"""Exponential back-off: the pause before each new attempt doubles, up to a maximum."""


class BackOff:
    """Computes when the next attempt may start; the caller passes the time."""

    def __init__(self, shortest: float, longest: float) -> None:
        """Allow the first attempt at once.

        ``shortest``, ``longest``: limits of the pause, s, 0 < shortest <= longest.
        """
        self._first, self._most = shortest, longest
        self._pause = shortest
        self._not_before = -1e9  # s, earlier than any clock reading

    def ready(self, now: float) -> bool:
        """Return True when the next attempt may start; ``now`` in s."""
        return now >= self._not_before

    def record_failure(self, now: float) -> None:
        """Record a failed attempt or a lost connection: start a pause, twice the one before."""
        self._not_before = now + self._pause
        self._pause = min(2.0 * self._pause, self._most)

    def record_success(self) -> None:
        """Record a success: the next pause is the shortest again."""
        self._pause = self._first
