"""The page of log fields: name, unit and meaning of every number of a log row, by kind of rig."""

from typing import Any, get_type_hints

from docs.generate.markdown import code, sentence, table
from docs.generate.meanings import meanings
from rig.kinds import registry
from rig.recording.row_layout import leaves

_HEAD = """# Log fields

A run records one row per tick. `rig plot RUN --field NAME` draws a field over time;
`open_run(RUN, fields=[NAME])` returns it with its unit. [Signs](../explanation/signs.md) defines
the directions.

"""


def page() -> str:
    """Return the page, with a section for each kind of rig whose rows have fixed fields."""
    return _HEAD + "\n".join(_section(name) for name in registry.OWN_PACKAGES)


def _section(name: str) -> str:
    row_type = registry.find(name).room("tick").find_kind("").row_type
    texts = dict(_meanings(row_type, ()))
    rows = (
        [code(leaf.name), "" if leaf.unit == "1" else leaf.unit, sentence(texts.get(leaf.path, ""))]
        for leaf in leaves(row_type)
    )
    return f"## Kind `{name}`\n\n" + table(["field", "unit", "meaning"], rows)


def _meanings(row_type: Any, path: tuple[str, ...]) -> Any:
    """Yield path and meaning of each number: its own text, or that of the group it is in."""
    own = meanings(row_type)
    for name, hint in get_type_hints(row_type).items():
        here = (*path, name)
        if hasattr(hint, "_fields"):
            about = (hint.__doc__ or "").partition("\n")[0]
            generated = about.startswith(f"{hint.__name__}(")  # by NamedTuple
            group = own.get(name) or ("" if generated else about)
            for below, text in _meanings(hint, here):
                yield below, text or group
        else:
            yield here, own.get(name, "")
