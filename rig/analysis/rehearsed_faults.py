"""The faults that were rehearsed on a rig's emulated devices, and how the rig reacted.

`rig faults` writes one file of a rehearsal into its folder, after each fault anew. Its hash covers
all of its contents. Certificates of campaigns and runs on the rig's devices name the newest one.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rig.config.differences import key_differences, value_text
from rig.recording import hashed_json
from rig.recording.runs.folder import FAULTS

_VERSION = 1
_PLACE = ("name", "plant", "interface", "channel", "options", "host", "port")
"""Keys of a rig file that have no part in a reaction; the last five are addresses of wires."""
_SHOWN_DIFFERENCES = 5


class RehearsedFaults(NamedTuple):
    """The newest rehearsal of faults on a rig."""

    folder: str
    content: dict[str, Any]
    differences: tuple[str, ...]  # values of rig, wiring and limits that are not those rehearsed

    def text(self) -> str:
        """Return one line for people."""
        content = self.content
        rows = content["faults"]
        wrong = [row["name"] for row in rows if not row["as_required"]]
        line = f"faults: {len(rows)} of {content['rows_of_table']} of {content['table']} in "
        line += f"{self.folder} ({content['rehearsed_utc'][:10]}), "
        line += f"{len(wrong)} NOT AS REQUIRED: {', '.join(wrong)}" if wrong else "all as required"
        if self.differences:
            named = self.differences[:_SHOWN_DIFFERENCES]
            line += f"; other values than rehearsed: {', '.join(named)}"
            if len(self.differences) > len(named):
                line += f" and {len(self.differences) - len(named)} more"
        return line

    def as_record(self) -> dict[str, Any]:
        """Return what a certificate says of them: folder, date, each fault with its reaction."""
        names = ("name", "required", "reaction", "seconds", "as_required")
        return {
            "folder": self.folder,
            "rehearsed_utc": self.content["rehearsed_utc"],
            "table": self.content["table"],
            "rows_of_table": self.content["rows_of_table"],
            "differences": list(self.differences),
            "faults": [{name: row[name] for name in names} for row in self.content["faults"]],
        }


def write_rehearsed_faults(
    folder: Path, config: Mapping[str, Any], head: Mapping[str, Any], rows: Sequence[dict[str, Any]]
) -> None:
    """Write the faults rehearsed so far; raises OSError.

    ``config``: of the task, with `rig` and `limits`; ``head``: table, rows_of_table, task, code,
    rehearsed_utc; ``rows``: name, required, reaction, category, seconds (s until no motor had
    power), allowed_seconds, as_required, differences (texts), run (folder) of each fault.
    """
    content = {"faults_file": _VERSION, **head, **_parts(config), "faults": list(rows)}
    hashed_json.write(folder, FAULTS, content)


def find_rehearsed_faults(runs: Path, config: Mapping[str, Any]) -> RehearsedFaults | None:
    """Return the newest rehearsal of faults in a folder of runs on the rig of a configuration.

    A rig is the same if its kind and the devices on its wires are; other values are named as
    differences. Files that are damaged, were changed or have no fault are passed over.
    """
    parts = _parts(config)
    for path in sorted(runs.glob(f"*/{FAULTS}"), reverse=True):
        content = hashed_json.read(path)
        if content is None or content.get("faults_file") != _VERSION or not content["faults"]:
            continue
        if (content["kind"], content["devices"]) != (parts["kind"], parts["devices"]):
            continue
        found = key_differences(content["values"], parts["values"])
        differences = tuple(
            f"{key} {value_text(new)} ({value_text(old)})" for key, old, new in found
        )
        return RehearsedFaults(path.parent.name, content, differences)
    return None


def _parts(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return kind, devices and values of the rig and limits of a configuration."""
    rig = config["rig"]
    wired = {name: part for name, part in (rig.get("wiring") or {}).items() if part is not None}
    return {
        "kind": rig["kind"],
        "devices": sorted(wired),
        "values": {"rig": _without_place(rig), "limits": config.get("limits")},
    }


def _without_place(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_place(part) for key, part in value.items() if key not in _PLACE}
    return [_without_place(each) for each in value] if isinstance(value, list) else value
