"""Markdown of generated pages."""

from collections.abc import Iterable, Sequence


def cell(text: object) -> str:
    """Return a text for a table's cell: one line, with its bars escaped."""
    return " ".join(str(text).split()).replace("|", "\\|")


def code(text: object) -> str:
    """Return a text as code; an empty text stays empty."""
    return f"`{text}`" if str(text) else ""


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table; columns without any content are left out."""
    lines = [[cell(each) for each in row] for row in rows]
    shown = [i for i in range(len(heads)) if i == 0 or any(line[i] for line in lines)]
    pick = [[line[i] for i in shown] for line in (list(heads), ["---"] * len(heads), *lines)]
    return "\n".join(f"| {' | '.join(line)} |" for line in pick) + "\n"


def sentence(text: str) -> str:
    """Return a text with a capital letter at its beginning and a full stop at its end."""
    text = " ".join(text.split())
    if not text:
        return ""
    ended = text if text[-1] in ".:!?" else f"{text}."
    first = text.split()[0]
    is_name = "." in first.rstrip(".") or "_" in first  # of the program, which keeps its letters
    return ended if is_name else ended[0].upper() + ended[1:]
