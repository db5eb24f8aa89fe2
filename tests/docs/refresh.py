"""Write real output and pictures into a page: `python -m tests.docs.refresh PAGE`.

Output that matches stays as it is, with its omitted lines; PAGE is a path in docs/ or README.md.
Pictures that the page's commands write are copied to the places that the page names.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from .page_files import path_of
from .pictures import pictures, store
from .runner import PageRun


def refresh(path: Path, folder: Path) -> list[str]:
    """Replace output that differs; return the findings that remain, as texts."""
    lines = path.read_text().splitlines()
    run = PageRun(path.read_text(), folder)
    findings = run.run()
    for shown in reversed(run.shown):
        if not shown.is_same:
            lines[shown.first : shown.last] = [
                f"{shown.indent}{line}".rstrip() for line in shown.real
            ]
    path.write_text("\n".join(lines) + "\n")
    for picture in pictures(path.read_text()):
        store(picture, folder, path)
    return [
        f"{path}:{finding.line}: {finding.text}"
        for finding in findings
        if not finding.text.startswith("output differs")
    ]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        remaining = refresh(path_of(sys.argv[1].removeprefix("docs/")), Path(scratch))
    print("\n".join(remaining))
    sys.exit(bool(remaining))
