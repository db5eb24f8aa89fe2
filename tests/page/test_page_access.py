"""Access to the page: its names, other sites, tokens and roles."""

from __future__ import annotations

import os
import socket

import pytest

from rig.page.access import (
    COOKIE,
    OPERATOR,
    VIEWER,
    Access,
    RateLimit,
    Token,
    local_names,
    new_tokens,
    peer_user,
)


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.mark.parametrize(
    ("host", "allowed"),
    [
        ("127.0.0.1:8765", True),
        ("localhost:8765", True),
        ("LOCALHOST", True),
        ("[::1]:8765", True),
        ("rig.example", False),
        ("127.0.0.1.rig.example:8765", False),
        ("", False),
    ],
)
def test_only_names_of_this_page_are_served(host: str, allowed: bool) -> None:
    assert (Access().host_problem({"host": host}) == "") is allowed


@pytest.mark.parametrize(
    ("origin", "allowed"),
    [
        ("http://127.0.0.1:8765", True),
        ("https://127.0.0.1:8765", True),
        ("http://127.0.0.1:9999", False),
        ("http://rig.example", False),
        ("null", False),
        ("", False),
    ],
)
def test_other_sites_are_refused(origin: str, allowed: bool) -> None:
    headers = {"host": "127.0.0.1:8765", "origin": origin}
    assert (Access().origin_problem(headers) == "") is allowed


def test_tokens_give_a_role_until_they_expire() -> None:
    clock = Clock()
    tokens = (Token(OPERATOR, "a" * 20, 200.0), Token(VIEWER, "b" * 20, 200.0))
    access = Access(tokens=tokens, clock=clock)

    def role(secret: str) -> str:
        return access.role({COOKIE: secret}, ("127.0.0.1", 1))

    assert (role("a" * 20), role("b" * 20), role("c" * 20), role("")) == (OPERATOR, VIEWER, "", "")
    assert access.role({}, ("127.0.0.1", 1)) == ""
    clock.now = 200.0
    assert (role("a" * 20), role("b" * 20)) == ("", "")


def test_tokens_are_not_guessed() -> None:
    clock = Clock()
    access = Access(tokens=(Token(OPERATOR, "a" * 20, 1e9),), clock=clock)
    assert [access.login("x")[0] for _ in range(5)] == [""] * 5
    assert access.login("a" * 20) == ("", 0.0)  # too many attempts in a second
    clock.now += 1.1
    assert access.login("a" * 20)[0] == OPERATOR


def test_new_tokens_differ() -> None:
    operator, viewer = new_tokens(10.0)
    assert operator.secret != viewer.secret
    assert len(operator.secret) >= 32


def test_the_user_of_a_local_connection_is_known() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        client = socket.create_connection(server.getsockname())
        accepted, address = server.accept()
        with client, accepted:
            assert peer_user(*address) == os.getuid()
            assert Access().role({}, address) == OPERATOR
    assert peer_user("127.0.0.1", 1) is None
    assert Access().role({}, ("127.0.0.1", 1)) == VIEWER
    assert Access().role({}, None) == ""


def test_names_of_this_computer() -> None:
    assert local_names("192.0.2.7") >= {"192.0.2.7", "127.0.0.1"}
    assert socket.gethostname() in local_names("0.0.0.0")


def test_rate_limit() -> None:
    clock = Clock()
    limit = RateLimit(2, 1.0, clock)
    assert [limit.allows() for _ in range(3)] == [True, True, False]
    clock.now += 1.0
    assert limit.allows()
