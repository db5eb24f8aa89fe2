"""Pictures of pages: copies, small in size, of files that the commands of the page write.

A comment before a picture names its source in the folder of the page's run; of several matches the
last one by name counts: `<!-- picture: runs/*_mine/surfaces.png -->`.
`python -m tests.docs.pictures SOURCE TARGET` reduces a picture that another program takes.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import NamedTuple

from PIL import Image

WIDTH = 1000  # pixels, at most
COLOURS = 256
_PICTURE = re.compile(
    r"<!-- picture: (?P<source>\S+) -->\n\s*!\[[^\]]*\]\((?P<target>[^)\s]+)\)", re.MULTILINE
)


class Picture(NamedTuple):
    """A picture of a page."""

    source: str  # pattern, relative to the folder of the page's run
    target: str  # relative to the page
    line: int  # of the page, of the comment, from 1


def pictures(page: str) -> list[Picture]:
    """Return the pictures of a page that its commands write."""
    return [
        Picture(each["source"], each["target"], page.count("\n", 0, each.start()) + 1)
        for each in _PICTURE.finditer(page)
    ]


def source_of(picture: Picture, folder: Path) -> Path | None:
    """Return the file that the commands wrote; None: there is none."""
    found = sorted(folder.glob(picture.source))
    return found[-1] if found else None


def store(picture: Picture, folder: Path, page: Path) -> None:
    """Write a small copy to the place that the page names."""
    if source := source_of(picture, folder):
        target = page.parent / picture.target
        target.parent.mkdir(parents=True, exist_ok=True)
        reduce(source, target)


def reduce(source: Path, target: Path) -> None:
    """Write a copy of few colours and at most `WIDTH` pixels."""
    image = Image.open(source).convert("RGB")
    if image.width > WIDTH:
        size = (WIDTH, round(image.height * WIDTH / image.width))
        image = image.resize(size, Image.Resampling.LANCZOS)
    few = image.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(target, optimize=True)


if __name__ == "__main__":
    reduce(Path(sys.argv[1]), Path(sys.argv[2]))
