"""MkDocs hook: adds the generated pages, and keeps every address of a page within the site."""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

os.environ["NO_MKDOCS_2_WARNING"] = "1"  # of the theme: mkdocs is below 2 in constraints.txt

from mkdocs.structure.files import File, Files

from docs.generate import (
    commands,
    fault_tables,
    law_list,
    log_fields,
    parts,
    repository_links,
    trip_reasons,
    yaml_keys,
)

ROOT = Path(__file__).resolve().parents[2]

SHIM = "https://unpkg.com/iframe-worker/shim"  # of the theme's offline search
OWN_SHIM = "assets/iframe-worker.js"

PAGES: dict[str, Callable[[], str]] = {
    "reference/cli.md": commands.page,
    "reference/yaml/index.md": yaml_keys.index,
    **{f"reference/yaml/{name}.md": partial(yaml_keys.page, name) for name in yaml_keys.FILES},
    "reference/law_list.md": law_list.page,
    "reference/log_fields.md": log_fields.page,
    "reference/trip_reasons.md": trip_reasons.page,
    "reference/faults.md": fault_tables.index,
    **{
        f"reference/faults_{name}.md": partial(fault_tables.page, name)
        for name in fault_tables.RIGS
    },
}
"""The generated pages by their path in the site."""

PUBLISHED = {
    "benchmarks/results/README.md": "reference/benchmarks.md",
}
"""Pages that show a file of the repository, by this file."""


def on_config(config: Any) -> Any:
    """Load the theme's script for searches in files from the site itself."""
    scripts = config.extra["polyfills"]
    config.extra["polyfills"] = [OWN_SHIM if each == SHIM else each for each in scripts]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages."""
    for path, page in PAGES.items():
        files.append(File.generated(config, path, content=page()))
    for source, path in PUBLISHED.items():
        text = repository_links.rewrite((ROOT / source).read_text(), "", ROOT, PUBLISHED)
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Add the generated parts, and name the files of the repository that a page links to."""
    return repository_links.rewrite(parts.fill(markdown), page.file.src_uri, ROOT, PUBLISHED)
