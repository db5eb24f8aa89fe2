"""The page of the command line: every command with its arguments, options and exit codes."""

from collections.abc import Iterator
from typing import Any

import typer

from docs.generate.markdown import code, sentence, table
from rig.cli.app import COMMANDS, app, load
from rig.kinds import registry

_HEAD = """# Commands

Every command is `rig COMMAND`. This page has the text of `rig COMMAND --help`.

Every command takes `--help`; those with `--json` print one JSON object for scripts. A campaign,
session or rig is a file (YAML), or the name of a shipped one (`rig campaigns` lists them).

"""


def page() -> str:
    """Return the page of all commands, in alphabetical order."""
    typer.main.get_command(app)
    listed = {each.name: each for each in (*COMMANDS, *registry.commands()) if " " not in each.name}
    found = [
        one for name in sorted(listed) for one in _with_members(f"rig {name}", load(listed[name]))
    ]
    index = table(
        ["command", "does"],
        ([f"[`{path}`](#{_anchor(path)})", _first(command)] for path, command in found),
    )
    return _HEAD + index + "".join(_section(path, command) for path, command in found)


def _with_members(path: str, command: Any) -> Iterator[tuple[str, Any]]:
    yield path, command
    for name, member in sorted(getattr(command, "commands", {}).items()):
        yield from _with_members(f"{path} {name}", member)


def _anchor(path: str) -> str:
    return path.replace(" ", "-")


def _first(command: Any) -> str:
    return sentence((command.help or "").strip().partition("\n\n")[0])


def _section(path: str, command: Any) -> str:
    arguments = [each for each in command.params if each.param_type_name == "argument"]
    options = [each for each in command.params if each.param_type_name == "option"]
    group = hasattr(command, "commands")
    names = [_argument_name(each) for each in arguments]
    usage = " ".join([path, *(["[OPTIONS]"] if options else []), *names, *["COMMAND"] * group])
    parts = [
        f"## {path} {{#{_anchor(path)}}}",
        (command.help or "").strip(),
        f"```text\n{usage}\n```",
    ]
    if arguments:
        rows = ([code(_argument_name(each)), each.help or "", _default(each)] for each in arguments)
        parts.append(table(["argument", "meaning", "default"], rows))
    if options:
        rows = (
            [code(_flags(each)), code(_type(each)), each.help or "", _default(each)]
            for each in sorted(options, key=lambda each: each.opts[0])
        )
        parts.append(table(["option", "value", "meaning", "default"], rows))
    if command.epilog:
        parts.append(_exit_codes(command.epilog))
    return "\n" + "\n\n".join(parts) + "\n"


def _argument_name(argument: Any) -> str:
    name = (argument.metavar or argument.name).strip("{}[]").upper()
    name += "..." if argument.nargs == -1 else ""
    return name if argument.required else f"[{name}]"


def _flags(option: Any) -> str:
    return ", ".join((*option.opts, *option.secondary_opts))


def _type(option: Any) -> str:
    if getattr(option, "is_flag", False):
        return ""
    kind = getattr(option, "type", None)
    choices = getattr(kind, "choices", None)
    if choices:
        return ", ".join(str(each) for each in choices)
    name = option.metavar or getattr(kind, "name", "") or ""
    repeated = " (may be repeated)" if getattr(option, "multiple", False) else ""
    return f"{str(name).upper()}{repeated}"


def _default(parameter: Any) -> str:
    value = parameter.default
    if parameter.required:
        return "required"
    if value is None or value is False or callable(value) or value in ((), [], ""):
        return ""
    return code("yes" if value is True else value)


def _exit_codes(epilog: str) -> str:
    """Return the exit codes as a list: the text is "Exit codes: 0 complete; 1 failed; ..."."""
    head, _, rest = " ".join(epilog.split()).partition(": ")
    if not head.lower().startswith("exit code"):
        return epilog
    lines = []
    for each in rest.rstrip(".").split("; "):
        number, _, text = each.partition(" ")
        lines.append([code(number), text] if number.isdigit() else ["", each])
    return table(["exit code", "meaning"], lines)
