"""Every page's blocks run, and the output that it shows is real."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet
from PIL import Image

from tests.docs.blocks import LANGUAGES, blocks, commands
from tests.docs.output import matches, normalise
from tests.docs.page_files import ROOT, all_pages, path_of
from tests.docs.refresh import refresh
from tests.docs.runner import PageRun

NOT_RUN = 5  # blocks of pages that cannot run here, each with its reason in the page


REAL_CLOCK = re.compile(r"^\$ .*rig .*(--realtime|--sim\b|faults .*--only|doctor)", re.MULTILINE)
"""Commands that take the host's real-time loop, which one process at a time may have."""


def _with_marks(page: str) -> ParameterSet:
    on_real_clock = REAL_CLOCK.search(path_of(page).read_text())
    return pytest.param(page, marks=[pytest.mark.realtime] if on_real_clock else [])


@pytest.mark.slow
@pytest.mark.timeout(2400)
@pytest.mark.parametrize("page", [_with_marks(page) for page in all_pages()])
def test_the_blocks_of_a_page_run_as_shown(page: str, tmp_path: Path) -> None:
    findings = PageRun(path_of(page).read_text(), tmp_path).run()
    shutil.rmtree(tmp_path)  # a run of a campaign has hundreds of megabytes
    assert not findings, "\n\n".join(f"{page}:{each.line}: {each.text}" for each in findings)


def test_blocks_that_cannot_run_are_counted() -> None:
    reasons = [
        f"{page}:{block.line}: {block.not_run}"
        for page in all_pages()
        for block in blocks(path_of(page).read_text())
        if block.not_run
    ]
    print("\n".join(reasons))
    assert len(reasons) == NOT_RUN, "\n".join(reasons)


@pytest.mark.parametrize("page", all_pages())
def test_blocks_have_a_known_language(page: str) -> None:
    found = [
        f"{block.line}: {block.language!r}"
        for block in blocks(path_of(page).read_text())
        if block.language not in LANGUAGES
    ]
    assert found == []


@pytest.mark.parametrize("page", all_pages())
def test_pictures_exist_and_have_a_text(page: str) -> None:
    path = path_of(page)
    for text, target in re.findall(r"!\[([^\]]*)\]\(([^)\s]+)\)", path.read_text()):
        assert len(text) > 10, f"{target} has no text for those who cannot see it"
        assert (path.parent / target).is_file(), target


EXAMPLE = """# Example

```yaml title="a.yaml"
first: 1
```

```yaml title="a.yaml (added)"
second: 2
```

```console
$ cat a.yaml
first: 1
second: 2
$ date +%Y-%m-%d
2020-01-01
$ seq 5
1
...
5
$ false
$ echo $?
1
$ mkdir below; cd below
$ basename $PWD
below
```

```python
number = 6
print(7 * number)
```

```text title="output"
42
```

<!-- not run: needs a rig -->
```console
$ exit 1
```
"""


def test_an_example_page_runs(tmp_path: Path) -> None:
    assert PageRun(EXAMPLE, tmp_path).run() == []


@pytest.mark.parametrize(
    ("old", "new", "finding"),
    [
        ("second: 2\n$", "second: 3\n$", "output differs"),
        ("```console\n$ cat", "```console\n$ false; cat b", "exits with 1"),
        ("$ echo $?\n1\n", "", "exits with 1"),
        ("...\n5", "...\n6", "output differs"),
        ("$ seq 5\n1", "$ seq 5\n2", "output differs"),
        ("print(7", "print(8", "output differs"),
        ("7 * number", "7 / 0", "ZeroDivisionError"),
        ('```yaml title="a.yaml"', "```yaml", "names its file"),
        ("first: 1\n```", "name: a\nrig: nowhere\nfirst: 1\n```", "refuses it"),
        ("<!-- not run: needs a rig -->\n", "", "exits with 1"),
    ],
)
def test_a_page_that_is_wrong_is_found(old: str, new: str, finding: str, tmp_path: Path) -> None:
    assert old in EXAMPLE
    found = PageRun(EXAMPLE.replace(old, new, 1), tmp_path).run()
    assert finding in found[0].text


def test_a_command_without_an_end_is_ended_with_its_programs(tmp_path: Path) -> None:
    page = "```console\n$ sleep 977 | cat\n```\n"
    (found,) = PageRun(page, tmp_path, timeout_s=0.5).run()
    assert "no end within 0.5 s" in found.text
    listed = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True)
    assert "sleep 977" not in listed.stdout.splitlines()


def test_output_is_refreshed(tmp_path: Path) -> None:
    page, folder = tmp_path / "page.md", tmp_path / "run"
    folder.mkdir()
    page.write_text(EXAMPLE.replace("\n42\n", "\n43\n44\n").replace("second: 2\n$", "$"))
    assert refresh(page, folder) == []
    assert page.read_text() == EXAMPLE


PICTURE = """```python
from PIL import Image
Image.new("RGB", (2000, 100), "navy").save("dark.png")
```

<!-- picture: da*.png -->
![A dark rectangle](pictures/dark.png){ width=100 }
"""


def test_pictures_are_those_of_the_commands(tmp_path: Path) -> None:
    page, folder = tmp_path / "page.md", tmp_path / "run"
    folder.mkdir()
    page.write_text(PICTURE)
    assert refresh(page, folder) == []
    with Image.open(tmp_path / "pictures" / "dark.png") as stored:
        assert stored.size == (1000, 50)
        assert stored.convert("RGB").getpixel((0, 0)) == (0, 0, 128)
    (finding,) = PageRun(PICTURE.replace('dark.png")', 'light.png")'), tmp_path).run()
    assert finding == (6, "no command of the page writes da*.png")


@pytest.mark.parametrize(
    ("shown", "real", "same"),
    [
        ("a\n...", "a\nb\nc", True),
        ("...\nc", "a\nb\nc", True),
        ("...\nb\n...", "a\nb\nc", True),
        ("...\nd\n...", "a\nb\nc", False),
        ("a\n...\na", "a", False),
        ("run 20261127T071038Z_quick", "run 20200101T000000Z_quick", True),
        ("run 20261127T071038Z_quick", "run 20200101T000000Z_slow", False),
        ("sweeps/a_0d9ab377d479/sweep.nc", "sweeps/a_e53c709d0989/sweep.nc", True),
        ("page  http://127.0.0.1:8765/", "page  http://127.0.0.1:43641/", True),
        ("power -84.6 W", "power -84.7 W", False),
        ("37.0 x real time", "9 x real time", True),
    ],
)
def test_outputs_are_compared(shown: str, real: str, *, same: bool) -> None:
    assert matches(shown.split("\n"), real.split("\n")) is same


def test_results_are_not_normalised() -> None:
    """Powers, counts of ticks and settings are compared to their last digit."""
    line = "  electrical AC  −51.96 ± <0.01 W   Kp  −2000  at 0.5 Hz, 87520 ticks, 1000 Hz"
    assert "<0.01 W" in normalise([line])[0]
    assert all(each in normalise([line])[0] for each in ("51.96", "87520", "1000", "0.5"))


def test_commands_may_have_several_lines() -> None:
    (block,) = blocks("```console\n$ rig sweep a.yaml \\\n>   --over b=1\nout\n```\n")
    (command,) = commands(block)
    assert command.text == "rig sweep a.yaml \\\n  --over b=1"
    assert command.shown == ["out"]


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150
