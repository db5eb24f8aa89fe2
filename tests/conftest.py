"""Settings that hold for all tests: which long tests run, and how a flaky test is reported."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
from pathlib import Path

import pytest
from costly_tests import COSTLY_PARTS, LIST, costly_parts, part_of
from hypothesis import settings

# A shared host pauses for longer than any example takes; speed is measured in benchmarks/.
settings.register_profile("all", deadline=None, max_examples=100)
settings.register_profile("part", deadline=None, max_examples=20)

# A shell starts background jobs with these signals ignored, and so are they in all children:
# a test that sends Ctrl-C would then wait for ever.
for _number, _default in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGQUIT, signal.SIG_DFL),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(_number) == signal.SIG_IGN:
        signal.signal(_number, _default)

PARTS = 8  # a run of the test command takes one in so many of the long and of the sampled tests
STREAMS = ("paired", "realtime")  # of the tests in real time: two at a time, or alone
FLAKY = "flaky"  # name of the list of flaky tests in pytest's cache


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the Makefile's test commands."""
    group = parser.getgroup("wec-rig")
    group.addoption(
        "--long",
        choices=("all", "part", "none"),
        default="all",
        help=f"long tests to run: all, a seeded part (one in {PARTS}), or none; unless all, only a"
        " seeded part of the cases of each sampled test and of the costly tests runs",
    )
    group.addoption(
        "--long-seed",
        default="",
        metavar="TEXT",
        help="seed of the part of the long tests; default: the commit",
    )
    group.addoption(
        "--idle",
        action="store_true",
        help="use only processor time that no other process needs",
    )
    group.addoption(
        "--second-try",
        action="store_true",
        help="report a test that passes now as flaky: it has failed in the run before",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Lower the priority, before worker processes start and inherit it; choose the profile."""
    settings.load_profile("all" if config.getoption("--long") == "all" else "part")
    if config.getoption("--idle"):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def _seed(config: pytest.Config) -> str:
    seed: str = config.getoption("--long-seed")
    if seed:
        return seed
    command = ["git", "rev-parse", "--short=12", "HEAD"]
    try:
        done = subprocess.run(
            command, check=False, cwd=config.rootpath, capture_output=True, text=True
        )
    except OSError:
        return "0"
    return done.stdout.strip() or "0"


def _place(seed: str, name: str) -> int:
    """Return a place of a name among all names that changes with the seed."""
    return int.from_bytes(hashlib.sha256(f"{seed}:{name}".encode()).digest()[:8], "big")


def _stream(item: pytest.Item) -> str:
    """Return which tests run with a test: in real time two by two or alone, or none of these."""
    names = [name for name in STREAMS if item.get_closest_marker(name)]
    return names[0] if names else ""


def _costly_left_out(root: Path, items: list[pytest.Item], seed: str) -> list[pytest.Item]:
    """Return the costly tests that are left out: those of all parts but one."""
    parts, chosen = costly_parts(root), _place(seed, LIST) % COSTLY_PARTS
    return [
        item
        for item in items
        if part_of(parts, item.nodeid, in_real_time=_stream(item) != "") not in {None, chosen}
    ]


def _long_left_out(items: list[pytest.Item], seed: str) -> list[pytest.Item]:
    """Return the long tests that are left out: of each `PARTS` by name all but one.

    Tests with one ``group`` share a run and count as one. Each stream counts alone: more tests of
    it than its share would take minutes. A ``soak`` runs in `make test-long` only.
    """
    units: dict[tuple[str, str], list[pytest.Item]] = {}
    soaks = [
        item
        for item in items
        if (marker := item.get_closest_marker("long")) and marker.kwargs.get("soak")
    ]
    for item in items:
        if (marker := item.get_closest_marker("long")) and item not in soaks:
            unit = _stream(item), marker.kwargs.get("group", item.nodeid)
            units.setdefault(unit, []).append(item)
    first, left_out = _place(seed, "long") % PARTS, soaks
    for stream in ("", *STREAMS):
        names = sorted(unit for unit in units if unit[0] == stream)
        for name in {*names} - {*names[first::PARTS]}:
            left_out += units[name]
    return left_out


def _unsampled(items: list[pytest.Item], seed: str) -> list[pytest.Item]:
    """Return the cases of sampled tests that are left out; of each at least one remains.

    The cases of tests with one ``pool`` are those of one test.
    """
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        if marker := item.get_closest_marker("sampled"):
            pool = marker.kwargs.get("pool", item.nodeid.partition("[")[0])
            cases.setdefault(pool, []).append(item)
    left_out = []
    for every in cases.values():
        every.sort(key=lambda item: _place(seed, item.nodeid))
        left_out += every[-(-len(every) // PARTS) :]
    return left_out


def pytest_report_header(config: pytest.Config) -> str | None:
    """Return a line that says which long tests run, and how to run the same part again."""
    if config.getoption("--long") != "part":
        return None
    return (
        f"long and sampled tests: one in {PARTS}, costly tests: one in {COSTLY_PARTS}; "
        "the same part again: "
        f"--long part --long-seed {_seed(config)}"
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect the long and sampled tests that this run leaves out."""
    which = config.getoption("--long")
    if which == "all" or config.getoption("--second-try"):  # all tests that failed were chosen
        return
    seed = _seed(config)
    left_out = set(_costly_left_out(config.rootpath, items, seed))
    if which == "none":
        left_out.update(item for item in items if item.get_closest_marker("long"))
    for unchosen in (_long_left_out, _unsampled):
        left_out.update(unchosen([item for item in items if item not in left_out], seed))
    config.hook.pytest_deselected(items=list(left_out))
    items[:] = [item for item in items if item not in left_out]


@pytest.hookimpl(trylast=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the tests that failed once and passed on the second try."""
    config = terminalreporter.config
    if not config.getoption("--second-try"):
        return
    passed = [report.nodeid for report in terminalreporter.getreports("passed")]
    if not passed:
        return
    terminalreporter.section("flaky: failed at first, passed when run again alone")
    for name in passed:
        terminalreporter.line(f"FLAKY {name}", yellow=True)
    path = Path(config.rootpath, ".pytest_cache", FLAKY)
    with path.open("a") as file:
        file.writelines(f"{name}\n" for name in passed)
