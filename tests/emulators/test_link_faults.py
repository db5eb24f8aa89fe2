"""The injector: what each fault does, that seeds repeat, that counts tell."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_plant.emulators.link_faults import FAULTS, LinkFaults, Severity

ALWAYS = Severity(drop=1.0, duplicate=1.0, corrupt=1.0, truncate=1.0, delay=0.25)


def struck(name: str) -> LinkFaults:
    link = LinkFaults(3, ALWAYS)
    link.switch(name)
    return link


def test_a_healthy_link_passes_everything_at_once() -> None:
    way = LinkFaults().to_host
    assert way.pass_on(b"abc", 1.5) == [(1.5, b"abc")]
    assert way.due(2.0) == []


@pytest.mark.parametrize(
    ("name", "arrives"),
    [
        ("drop", []),
        ("delay", [(1.25, b"\0\0\0")]),
        ("duplicate", [(1.0, b"\0\0\0"), (1.0, b"\0\0\0")]),
        ("freeze", []),
        ("disconnect", []),
    ],
)
def test_what_arrives(name: str, arrives: list[tuple[float, bytes]]) -> None:
    link = struck(name)
    assert link.to_device.pass_on(b"\0\0\0", 1.0) == arrives
    assert link.counts()[f"device.{name}"] == 1
    assert link.counts()["device.handed over"] == 1
    assert link.disconnected is (name == "disconnect")


def test_corrupt_flips_one_bit() -> None:
    ((_, piece),) = struck("corrupt").to_host.pass_on(bytes(8), 0.0)
    assert len(piece) == 8
    assert int.from_bytes(piece, "big").bit_count() == 1


def test_truncated_pieces_are_shorter() -> None:
    way = struck("truncate").to_host
    sizes = [len(piece) for _ in range(40) for _, piece in way.pass_on(bytes(8), 0.0)]
    assert set(sizes) == set(range(1, 8))  # cut to nothing, a piece is not there at all
    assert way.counts["truncate"] == 40


def test_a_thawed_link_gives_all_at_once_and_in_order() -> None:
    link = struck("freeze")
    for k in range(3):
        assert link.to_host.pass_on(bytes((k,)), float(k)) == []
    assert link.to_host.due(5.0) == []
    link.switch("freeze", False)
    assert link.to_host.due(6.0) == [(6.0, b"\0"), (6.0, b"\1"), (6.0, b"\2")]


def test_babble_comes_unasked_and_by_its_period() -> None:
    link = struck("babble")
    bursts = [piece for k in range(100) for _, piece in link.to_host.due(0.001 * k)]
    assert 9 <= len(bursts) <= 10
    assert all(len(burst) == 16 for burst in bursts)


def test_one_direction_alone() -> None:
    link = LinkFaults(0, ALWAYS)
    link.switch("drop", toward="host")
    assert link.to_host.pass_on(b"x", 0.0) == []
    assert link.to_device.pass_on(b"x", 0.0) == [(0.0, b"x")]


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ValueError, match="gremlins"):
        LinkFaults().switch("gremlins")


@given(st.lists(st.tuples(st.sampled_from(sorted(FAULTS)), st.booleans(), st.binary())))
def test_a_seed_repeats_itself_and_order_is_kept(story: list[tuple[str, bool, bytes]]) -> None:
    """The same story twice gives the same arrivals, and times never go back."""

    def told() -> list[tuple[float, bytes]]:
        link = LinkFaults(7, Severity(jitter=0.02))
        arrivals = []
        for k, (name, on, data) in enumerate(story):
            link.switch(name, on)
            arrivals += link.to_host.pass_on(data, 0.01 * k) + link.to_host.due(0.01 * k)
        return arrivals

    first = told()
    assert first == told()
    times = [at for at, _ in first]
    assert times == sorted(times)


def test_branches_share_faults_and_keep_their_own_pieces() -> None:
    link = struck("freeze")
    one, other = link.to_host.branch(), link.to_host.branch()
    one.pass_on(b"one", 0.0)
    other.pass_on(b"other", 0.0)
    link.clear()
    assert one.due(1.0) == [(1.0, b"one")]
    assert other.due(1.0) == [(1.0, b"other")]
    assert link.counts()["host.freeze"] == 2
