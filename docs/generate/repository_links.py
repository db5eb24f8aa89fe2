"""Links from pages to files of the repository, which the site does not contain."""

import os
import re
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

_LINK = re.compile(r"(?<!!)\[(?P<text>[^\]]+)\]\((?P<target>[^)\s#]+)(?P<anchor>#[^)\s]*)?\)")


def rewrite(markdown: str, page: str, root: Path, published: Mapping[str, str]) -> str:
    """Return a page whose links to files outside docs/ name these files instead.

    ``page``: its path in docs/; ``published``: pages of the site by the file of the repository that
    they show. A link to a file that does not exist is left as it is: the strict build reports it.
    """
    folder = PurePosixPath("docs", page).parent

    def replaced(match: re.Match[str]) -> str:
        text, target, anchor = match["text"], match["target"], match["anchor"] or ""
        if "://" in target:
            return match.group()
        path = os.path.normpath(folder / target)
        if path in published:
            shown = os.path.relpath(PurePosixPath("docs", published[path]), folder)
            return f"[{text}]({shown}{anchor})"
        if path.startswith("docs/") or not (root / path).exists():
            return match.group()
        plain = text.replace("`", "")
        return f"`{path}`" if path.endswith(plain) else f"{text} (`{path}`)"

    return _LINK.sub(replaced, markdown)
