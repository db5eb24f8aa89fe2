"""The page of the control laws that come with the program, from their modules."""

from controllers.law import Column, Parameter
from docs.generate.markdown import code, sentence, table
from rig import laws
from rig.kinds.modular.columns import axis_law

_HEAD = """# List of control laws

These laws come with the program. `rig laws` prints the laws of your host, those of plug-ins too.
[Control laws](laws.md) explains how a campaign chooses a law.

The second key is that of an axis that rotates: N*m replaces N, and rad replaces m. Ranges and
defaults keep their numbers. In a rig with several axes a key begins with the axis, for example
`heave_kp_n_s_per_m`.
"""
_HEADS = ["key", "key of a rotating axis", "unit", "unit there", "range", "default", "meaning"]


def page() -> str:
    """Return the page: columns and parameters of each law."""
    return _HEAD + "".join(_section(laws.own(name)) for name in laws.OWN_MODULES)


def _section(law: laws.Law) -> str:
    turned = axis_law(law, "", rotates=True)
    summary = (law.module.__doc__ or "").strip().splitlines()[0]
    parts = [f"\n## {sentence(law.name).rstrip('.')}\n\n{sentence(summary)}\n"]
    parts += ["\n`linear` form: yes\n" if law.linear is not None else ""]
    parts += ["\nColumns of the gain matrix:\n\n", _table(law.columns, turned.columns)]
    if law.parameters:
        parts += ["\nParameters below `law:`:\n\n", _table(law.parameters, turned.parameters)]
    return "".join(parts)


def _table(
    entries: tuple[Column, ...] | tuple[Parameter, ...],
    turned: tuple[Column, ...] | tuple[Parameter, ...],
) -> str:
    rows = []
    for entry, rotary in zip(entries, turned, strict=True):
        is_other = entry.key != rotary.key
        listed = isinstance(entry, Parameter) and entry.listed
        rows.append([
            code(entry.key),
            code(rotary.key) if is_other else "",
            code(entry.unit) + (", a list" if listed else ""),
            code(rotary.unit) if rotary.unit != entry.unit else "",
            f"{entry.low:g} .. {entry.high:g}",
            _default(entry.default),
            sentence(entry.help),
        ])  # fmt: skip
    return table(_HEADS, rows)


def _default(default: float | tuple[float, ...] | None) -> str:
    if isinstance(default, tuple):
        return ", ".join(f"{value:g}" for value in default) or "required"
    return "required" if default is None else f"{default:g}"
