"""`rig laws`: the control laws that a campaign may use."""

from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.options import Json
from rig.cli.output import BAD_INPUT, OK, print_json
from rig.laws import Law, LawError, RegisteredLaw, find, registered


def command(
    laws: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[LAW]...", help="Names of laws, or their files (.py); default: all names."
        ),
    ] = None,
    as_json: Json = False,
) -> int:
    """List the control laws: columns of the matrix, parameters, ranges."""
    listed = [_entry(text) for text in laws] if laws else list(registered())
    if as_json:
        print_json({"laws": [_as_dict(entry) for entry in listed]})
    else:
        print("\n\n".join(_text(entry) for entry in listed))
    return BAD_INPUT if laws and any(entry.problem for entry in listed) else OK


def _entry(text: str) -> RegisteredLaw:
    """Return a law by its name or the path of its file, with the problem if there is one."""
    try:
        law = find(text)
    except LawError as error:
        return RegisteredLaw(Path(text).stem, text, None, str(error))
    return RegisteredLaw(law.name, law.origin, law, "")


def _as_dict(entry: RegisteredLaw) -> dict[str, Any]:
    law = entry.law
    if law is None:
        return {"name": entry.name, "origin": entry.origin, "problem": entry.problem}
    return {
        **law.record(),
        "linear": law.linear is not None,
        "columns": [column._asdict() for column in law.columns],
        "parameters": [parameter._asdict() for parameter in law.parameters],
    }


def _text(entry: RegisteredLaw) -> str:
    if entry.law is None:
        return f"{entry.name}   ({entry.origin})\n  cannot be used: {entry.problem}"
    law: Law = entry.law
    summary = (law.module.__doc__ or "").strip().splitlines()
    lines = [f"{law.name}   ({entry.origin})", *([f"  {summary[0]}"] if summary else [])]
    lines.append("  columns of the matrix")
    for column in law.columns:
        default = "" if column.default is None else f"; {column.default:g} without the column"
        lines.append(_line(column.key, column.low, column.high, column.unit, column.help, default))
    if law.parameters:
        lines.append("  parameters below `law:`")
    for parameter in law.parameters:
        default = ", ".join(f"{value:g}" for value in parameter.default)
        default = f"; default {default}" if default else "; required"
        unit = f"{parameter.unit}, a list" if parameter.listed else parameter.unit
        lines.append(
            _line(parameter.key, parameter.low, parameter.high, unit, parameter.help, default)
        )
    return "\n".join(lines)


def _line(key: str, low: float, high: float, unit: str, help_text: str, default: str) -> str:
    return f"    {key:<26} {low:g} .. {high:g} {unit}{default}\n      {help_text}"
