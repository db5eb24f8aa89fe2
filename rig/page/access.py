"""Access to the page: who connects, from where, and in which role.

On the loopback address without tokens the user of the run is operator; with tokens everybody needs
one. A browser keeps its token as a cookie of this site alone (SameSite=strict).
"""

import hmac
import os
import secrets
import socket
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

VIEWER, OPERATOR = "viewer", "operator"
COOKIE = "rig_page"
LOOPBACK = ("127.0.0.1", "localhost", "::1")
LOGINS_PER_S = 5  # of all browsers together: a token cannot be guessed


class Token(NamedTuple):
    """A secret that gives a role until it expires."""

    role: str
    secret: str
    expires: float  # of the monotonic clock, s


def new_tokens(valid_s: float) -> tuple[Token, Token]:
    """Return new tokens of an operator and of viewers."""
    expires = time.monotonic() + valid_s
    return (
        Token(OPERATOR, secrets.token_urlsafe(24), expires),
        Token(VIEWER, secrets.token_urlsafe(24), expires),
    )


class RateLimit:
    """At most so many events in a time."""

    def __init__(
        self, events: int, seconds: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._times: deque[float] = deque(maxlen=events)
        self._seconds, self._clock = seconds, clock

    def allows(self) -> bool:
        """Return whether one more event is allowed now, and count it if so."""
        now = self._clock()
        if len(self._times) == self._times.maxlen and now - self._times[0] < self._seconds:
            return False
        self._times.append(now)
        return True


class Access:
    """Decides who may connect."""

    def __init__(
        self,
        hosts: Iterable[str] = LOOPBACK,
        tokens: Iterable[Token] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """``hosts``: names and addresses by which browsers may call this page."""
        self._hosts = {each.lower() for each in hosts}
        self._tokens, self._clock = tuple(tokens), clock
        self._logins = RateLimit(LOGINS_PER_S, 1.0, clock)

    @property
    def needs_token(self) -> bool:
        """Whether nobody connects without a token."""
        return bool(self._tokens)

    def host_problem(self, headers: Mapping[str, str]) -> str:
        """Return why a request's Host header is refused (another name: DNS rebinding), or ''."""
        name = urlsplit(f"//{headers.get('host', '')}").hostname or ""
        return "" if name in self._hosts else f"{name or 'no name'}: not a name of this page"

    def origin_problem(self, headers: Mapping[str, str]) -> str:
        """Return why a request comes from a page of another site, or ''."""
        origin = urlsplit(headers.get("origin", ""))
        same = origin.scheme in ("http", "https") and origin.netloc == headers.get("host", "")
        return "" if same else "the request comes from another site"

    def login(self, given: str) -> tuple[str, float]:
        """Return role and remaining time (s) of a token; an empty role for an invalid one."""
        if not self._logins.allows():
            return "", 0.0
        return self._find(given)

    def role(self, cookies: Mapping[str, str], client: tuple[str, int] | None) -> str:
        """Return the role of a connection; empty: none."""
        if self._tokens:
            return self._find(cookies.get(COOKIE, ""))[0]
        if client is None:
            return ""
        return OPERATOR if peer_user(*client) in (0, os.getuid()) else VIEWER

    def _find(self, given: str) -> tuple[str, float]:
        found, left = "", 0.0
        for token in self._tokens:  # all of them: the time must not depend on which one fits
            same = hmac.compare_digest(token.secret.encode(), given.encode())
            if same and self._clock() < token.expires:
                found, left = token.role, token.expires - self._clock()
        return found, left


def local_names(host: str) -> set[str]:
    """Return the names and addresses of this computer under which it serves ``host``."""
    if host not in ("0.0.0.0", "::"):
        return {host, *LOOPBACK}
    name = socket.gethostname()
    try:
        addresses = {str(each[4][0]) for each in socket.getaddrinfo(name, None)}
    except OSError:
        addresses = set()
    return {name, socket.getfqdn(name), *addresses, *LOOPBACK}


def peer_user(address: str, port: int) -> int | None:
    """Return the user of a connection from this computer; None if it is not found."""
    for table, family in (("tcp", socket.AF_INET), ("tcp6", socket.AF_INET6)):
        try:
            lines = Path(f"/proc/net/{table}").read_text().splitlines()[1:]
            packed = socket.inet_pton(family, address)
        except OSError:
            continue
        groups = (packed[i : i + 4][::-1].hex().upper() for i in range(0, len(packed), 4))
        local = f"{''.join(groups)}:{port:04X}"
        for line in lines:
            parts = line.split()
            if parts[1] == local:
                return int(parts[7])
    return None
