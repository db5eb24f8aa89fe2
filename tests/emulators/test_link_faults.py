"""Link faults: effect of each fault, reproducibility by seed, counts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_plant.emulators.link_faults import FAULTS, LinkFaults, Severity

ALWAYS = Severity(drop=1.0, duplicate=1.0, corrupt=1.0, truncate=1.0, delay=0.25)


def link_with_fault(name: str) -> LinkFaults:
    link = LinkFaults(3, ALWAYS)
    link.switch(name)
    return link


def test_a_healthy_link_passes_everything_at_once() -> None:
    direction = LinkFaults().to_host
    assert direction.transmit(b"abc", 1.5) == [(1.5, b"abc")]
    assert direction.due_arrivals(2.0) == []


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
def test_arrivals_of_each_fault(name: str, arrives: list[tuple[float, bytes]]) -> None:
    link = link_with_fault(name)
    assert link.to_device.transmit(b"\0\0\0", 1.0) == arrives
    assert link.counts()[f"device.{name}"] == 1
    assert link.counts()["device.handed over"] == 1
    assert link.disconnected is (name == "disconnect")


def test_corrupt_flips_one_bit() -> None:
    ((_, piece),) = link_with_fault("corrupt").to_host.transmit(bytes(8), 0.0)
    assert len(piece) == 8
    assert int.from_bytes(piece, "big").bit_count() == 1


def test_truncated_pieces_are_shorter() -> None:
    direction = link_with_fault("truncate").to_host
    sizes = [len(piece) for _ in range(40) for _, piece in direction.transmit(bytes(8), 0.0)]
    assert set(sizes) == set(range(1, 8))  # a piece truncated to nothing is lost
    assert direction.counts["truncate"] == 40


def test_unfrozen_link_delivers_all_pieces_in_order() -> None:
    link = link_with_fault("freeze")
    for k in range(3):
        assert link.to_host.transmit(bytes((k,)), float(k)) == []
    assert link.to_host.due_arrivals(5.0) == []
    link.switch("freeze", False)
    assert link.to_host.due_arrivals(6.0) == [(6.0, b"\0"), (6.0, b"\1"), (6.0, b"\2")]


def test_babble_arrives_periodically() -> None:
    link = link_with_fault("babble")
    bursts = [piece for k in range(100) for _, piece in link.to_host.due_arrivals(0.001 * k)]
    assert 9 <= len(bursts) <= 10
    assert all(len(burst) == 16 for burst in bursts)


def test_faults_in_one_direction() -> None:
    link = LinkFaults(0, ALWAYS)
    link.switch("drop", toward="host")
    assert link.to_host.transmit(b"x", 0.0) == []
    assert link.to_device.transmit(b"x", 0.0) == [(0.0, b"x")]


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ValueError, match="gremlins"):
        LinkFaults().switch("gremlins")


@given(st.lists(st.tuples(st.sampled_from(sorted(FAULTS)), st.booleans(), st.binary())))
def test_equal_seeds_give_equal_ordered_arrivals(story: list[tuple[str, bool, bytes]]) -> None:
    """The same sequence twice gives the same arrivals, and times never decrease."""

    def play_story() -> list[tuple[float, bytes]]:
        link = LinkFaults(7, Severity(jitter=0.02))
        arrivals = []
        for k, (name, on, data) in enumerate(story):
            link.switch(name, on)
            arrivals += link.to_host.transmit(data, 0.01 * k) + link.to_host.due_arrivals(0.01 * k)
        return arrivals

    first = play_story()
    assert first == play_story()
    times = [at for at, _ in first]
    assert times == sorted(times)


def test_branches_share_faults_but_not_pieces() -> None:
    link = link_with_fault("freeze")
    first_branch, other_branch = link.to_host.branch(), link.to_host.branch()
    first_branch.transmit(b"one", 0.0)
    other_branch.transmit(b"other", 0.0)
    link.clear()
    assert first_branch.due_arrivals(1.0) == [(1.0, b"one")]
    assert other_branch.due_arrivals(1.0) == [(1.0, b"other")]
    assert link.counts()["host.freeze"] == 2
