"""`rig kinds`: the kinds of rig that a rig file may name."""

from rig.cli.options import Json
from rig.cli.output import OK, print_json
from rig.kinds.registry import RegisteredKind, registered


def command(as_json: Json = False) -> int:
    """List the kinds of rig, with origin and version."""
    listed = registered()
    if as_json:
        print_json({"kinds": [_as_dict(each) for each in listed]})
    else:
        print("\n".join(_text(each) for each in listed))
    return OK


def _as_dict(registered_kind: RegisteredKind) -> dict[str, str]:
    kind, problem = registered_kind
    facts = {"name": kind.name, "origin": kind.origin, "package": kind.package}
    return facts | ({"problem": problem} if problem else {"summary": kind.summary})


def _text(registered_kind: RegisteredKind) -> str:
    kind, problem = registered_kind
    text = f"cannot be used: {problem}" if problem else kind.summary
    return f"{kind.name}   ({kind.origin}, {kind.package})\n  {text}"
