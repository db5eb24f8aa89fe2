"""The campaigns that supply what the runs given to a recommendation lack, as commands to type."""

from collections.abc import Sequence
from pathlib import Path

from rig.config.problems import display_path
from rig.config.shipped_files import CAMPAIGNS, RIGS, shipped_files
from rig.recording.runs import RunInfo

IDENTIFICATION = "identification"
IN_WAVES = "default"
_DURATIONS = "65 min; identification_short: 7 min, with fewer lines"


def identification_text(runs: Sequence[RunInfo]) -> str:
    """Return how to measure the device in calm water, on the rig of the runs."""
    options = _rig_option(runs[0]) if runs else ""
    names = " ".join(dict.fromkeys(run.run for run in runs if run.plan.get("reference") is None))
    return (
        f"run `rig run {IDENTIFICATION}{options}` ({_DURATIONS}), and give its run first: "
        f"{IDENTIFICATION} {names}".rstrip()
    )


def no_calm_water_text(runs: Sequence[RunInfo], rows_in_waves: int) -> str:
    """Return why runs without an open-loop row in calm water do not serve, and what to run."""
    reason = ""
    if rows_in_waves:
        reason = (
            f": of the {rows_in_waves} rows in waves alone, the device's impedance and the waves' "
            "force on it cannot be separated"
        )
    return f"no row in calm water with an open-loop reference{reason}; {identification_text(runs)}"


def in_waves_text(runs: Sequence[RunInfo]) -> str:
    """Return how to give the sea for which gains are recommended."""
    options = _rig_option(runs[0]) if runs else ""
    return (
        f"name a campaign with the sea by --campaign, for example --campaign {IN_WAVES}, or run "
        f"`rig run {IN_WAVES}{options}` and add its run"
    )


def campaign_of(run: RunInfo) -> Path | None:
    """Return the campaign file of a run; None if neither it nor a shipped one is the same.

    The recorded path may be relative to another folder: a shipped file is known by its sha256.
    """
    from rig.planning.input_files import hash_input_file  # noqa: PLC0415

    recorded = _file(run, "campaign")
    if recorded is None:
        return None
    path = Path(recorded["path"])
    if path.is_file():
        return path
    for shipped in shipped_files(CAMPAIGNS):
        is_same = shipped.path.name == path.name and (
            hash_input_file("campaign", shipped.path).sha256 == recorded.get("sha256")
        )
        if is_same:
            return shipped.path
    return None


def _rig_option(run: RunInfo) -> str:
    """Return the option that names the rig of a run; empty for that of the campaigns here."""
    recorded = _file(run, "rig")
    if recorded is None:
        return ""
    path = Path(recorded["path"])
    names = {each.path.name: each.name for each in shipped_files(RIGS)}
    name = names.get(path.name) if not path.is_file() or "configs" in path.parts else None
    return "" if name == "wavebot" else f" --rig {name or display_path(path)}"


def _file(run: RunInfo, role: str) -> dict[str, str] | None:
    files = run.config.get("files") or ()
    return next((file for file in files if file.get("role") == role), None)
