"""The site builds without a warning, and loads nothing from outside."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from benchmarks.support.chromium import PROGRAM, Chromium
from docs.generate import commands, log_fields, meanings, repository_links, trip_reasons, yaml_keys
from rig.cli.app import COMMANDS
from rig.config.rig_file import Motor, Operator
from rig.config.sea import JonswapSea
from rig.kinds import registry
from rig.realtime.reasons import NO_REASON
from rig.recording.row_layout import leaves
from tests.docs.page_files import ROOT

LOADED = {("script", "src"), ("img", "src"), ("iframe", "src"), ("source", "src"), ("video", "src")}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site."""
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir"]
    done = subprocess.run(
        [*build, str(folder)], cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_warnings_of_the_site_are_errors() -> None:
    """With --quiet MkDocs counts no warnings, and --strict has no effect."""
    (command,) = re.findall(r"mkdocs build.*", (ROOT / "Makefile").read_text())
    assert "--strict" in command
    assert "--quiet" not in command


class Page(HTMLParser):
    """The addresses and anchors of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []  # addresses that a browser loads with the page
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect the addresses of a tag."""
        found = {key: value or "" for key, value in attrs}
        self.anchors |= {found[key] for key in ("id", "name") if key in found}
        self.loads += [value for key, value in found.items() if (tag, key) in LOADED]
        self.loads += re.findall(r"url\((.*?)\)", found.get("style", ""))
        if tag == "link" and found.get("rel") != "canonical":
            self.loads.append(found["href"])
        if tag == "a" and "href" in found:
            self.links.append(found["href"])


def pages(site: Path) -> Iterator[tuple[Path, Page]]:
    """Yield every page of a site and its addresses."""
    for path in sorted(site.rglob("*.html")):
        yield path, Page(path.read_text())


def external_loads(text: str) -> list[str]:
    """Return the addresses outside the site that a browser loads with a page."""
    return [each for each in Page(text).loads if re.match(r"\w+:|//", each) and "data:" not in each]


def test_pages_load_nothing_from_outside(site: Path) -> None:
    found = {path.name: external_loads(path.read_text()) for path in site.rglob("*.html")}
    assert len(found) > 40
    assert {name: each for name, each in found.items() if each} == {}
    styles = "".join(path.read_text() for path in site.rglob("*.css"))
    assert re.findall(r"(?:url\(|@import )[\"']?(?:https?:)?//[^)]*", styles) == []


@pytest.mark.parametrize(
    "tag",
    [
        '<script src="https://unpkg.com/a.js"></script>',
        '<link rel="stylesheet" href="//fonts.googleapis.com/css">',
        '<img alt="" src="http://example.org/a.png">',
        '<p style="background: url(https://example.org/a.png)">',
    ],
)
def test_external_addresses_are_found(tag: str) -> None:
    assert len(external_loads(f"<html>{tag}</html>")) == 1


def test_links_lead_to_pages_and_anchors(site: Path) -> None:
    every = dict(pages(site))
    dead = []
    for path, page in every.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or path.name == "404.html":
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if target not in every:
                dead += [] if target.is_file() else [f"{path.name}: {link}"]
            elif parts.fragment and unquote(parts.fragment) not in every[target].anchors:
                dead.append(f"{path.name}: {link}")
    assert dead == []


@pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")
def test_the_search_works_from_a_folder_without_a_network(site: Path, tmp_path: Path) -> None:
    browser = Chromium(tmp_path / "profile")
    try:
        browser.call("Page.navigate", url=f"file://{site}/index.html")
        browser.wait("document.readyState === 'complete' && location.protocol === 'file:'")
        browser.run("document.querySelector('.md-search__input').focus()")
        browser.type("STALE_ENCODER")
        browser.wait("document.querySelectorAll('.md-search-result__item').length > 0")
        found = browser.run("document.querySelector('.md-search-result__list').textContent")
        assert "Trip reasons" in found
        assert browser.failed == []
    finally:
        browser.close()


def test_the_page_of_commands_has_every_command_and_option() -> None:
    page = commands.page()
    names = {each.name for each in (*COMMANDS, *registry.commands())}
    assert {name for name in names if f"\n## rig {name} {{" not in page} == set()
    done = subprocess.run(
        [sys.executable, "-m", "rig", "run", "--help"],
        capture_output=True, text=True, check=True, env={**os.environ, "COLUMNS": "200"},
    )  # fmt: skip
    section = page.partition("\n## rig run {")[2].partition("\n## ")[0]
    options = set(re.findall(r"--[a-z-]+", done.stdout)) - {"--help"}
    assert len(options) > 5
    assert {option for option in options if option not in section} == set()


def test_the_page_of_log_fields_has_every_field() -> None:
    page = log_fields.page()
    for name in registry.OWN_PACKAGES:
        row_type = registry.find(name).room("tick").find_kind("").row_type
        assert all(f"| `{leaf.name}` |" in page for leaf in leaves(row_type))


def test_the_page_of_trip_reasons_has_every_number_once() -> None:
    page = trip_reasons.page()
    for name in registry.OWN_PACKAGES:
        for reason in registry.find(name).room("tick").find_kind("").reason_table.reasons:
            assert f"| {reason.number} | `{reason.name}` | {reason.category} |" in page
            assert reason.advice or reason.number == NO_REASON, reason


def test_the_pages_of_yaml_keys_have_range_unit_and_default() -> None:
    session, limits = yaml_keys.page("session"), yaml_keys.page("limits")
    campaign = yaml_keys.page("campaign")
    assert "Rate of the magnetic spring alone" in campaign  # of the column's type
    assert "none: while the law acts" in yaml_keys.page("faults")
    assert "| `amplitude_m` | number | m | 0.001 .. 0.5 |" in campaign
    assert "| `gamma` | number |  | 1 .. 7 | `3.3` |" in campaign
    assert "voltage_stop_v" in limits
    assert "kind `oswec bench`".lower() in session.lower()


def test_every_key_has_a_meaning() -> None:
    assert yaml_keys.keys_without_meaning() == {}


def test_meanings_are_read_from_comments_docstrings_and_types() -> None:
    assert meanings.meanings(Motor)["encoder_noise_counts"].startswith("standard deviation")
    assert meanings.meanings(Operator)["dead_man_s"].startswith("Time in manual mode")
    assert meanings.meanings(JonswapSea)["hs_m"] == "Significant wave height, m."


def test_links_to_files_of_the_repository_become_their_names() -> None:
    text = "See [limits](../../configs/limits/wavebot.yaml) and [x](../signs.md), [y](../../no.md)."
    assert repository_links.rewrite(text, "how_to/page.md", ROOT, {}) == (
        "See limits (`configs/limits/wavebot.yaml`) and [x](../signs.md), [y](../../no.md)."
    )
