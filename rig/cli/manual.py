"""`rig manual FILE`: run a rig in manual mode."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from rig.campaign import CampaignKind
from rig.campaign.derived_file import derived_name
from rig.campaign.manual import text_of_rows
from rig.cli.input_files import CAMPAIGNS, RIGS, input_file
from rig.cli.options import RUNS, Interpreted, Json, Realtime, Runs, Sim, WithPage
from rig.cli.output import input_errors
from rig.cli.run import EXIT_CODES, RunOptions, run_named
from rig.config.problems import ConfigError
from rig.config.yaml_source import load_mapping
from rig.kinds.registry import KindError
from rig.kinds.rig_file import kind_of
from rig.planning.input_files import ConfigSource, load_named_source

__all__ = ["EXIT_CODES"]
_FILE_HELP = "Rig or campaign: file (YAML), or the name of a shipped one. A rig runs in calm water."


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help=_FILE_HELP)],
    realtime: Realtime = False,
    sim: Sim = False,
    interpreted: Interpreted = False,
    unattended: Annotated[
        bool, typer.Option("--unattended", help="Go on without an operator (no dead man's time).")
    ] = False,
    no_arming: Annotated[
        bool, typer.Option("--no-arming", help="Switch power on at once, not when it is armed.")
    ] = False,
    kept: Annotated[
        Path, typer.Option("--kept", help="Campaign file for the set points that you keep as rows.")
    ] = Path("kept_rows.yaml"),
    page: WithPage = False,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Run a rig in manual mode.

    After the tare the run waits in standby until an operator arms it. Then the
    drive is on with all gains zero, and the operator changes gains, drive
    settings and the signal generator, with the page or with `rig request`. Each
    change is a whole set point: checked as a row of a campaign, ramped, logged.
    `rig request finish` ends the run.
    """
    with TemporaryDirectory(prefix="wec-rig-") as folder:
        with input_errors("manual", as_json=as_json):
            origin = input_file(file, CAMPAIGNS, RIGS)
            path = _write_campaign(origin, Path(folder))
        options = RunOptions(
            None,
            realtime,
            sim,
            interpreted,
            arm=not no_arming,
            manual=origin,
            unattended=unattended,
            page=page,
            kept=kept.absolute(),
        )
        return run_named("manual", path, runs, options, as_json=as_json)


def _write_campaign(file: Path, folder: Path) -> Path:
    """Write the campaign for manual mode of a rig or of a campaign; return its path."""
    mapping, _ = load_mapping(file, inline=("sea", "tank"))
    path = folder / "manual.yaml"
    name = derived_name(str(mapping.get("name", "") if "rig" in mapping else file.stem), "-manual")
    path.write_text(text_of_rows(file, path, name, [({}, "")]))
    campaign = ConfigSource(*load_mapping(path, inline=("sea", "tank")))
    rig = load_named_source(campaign, ("rig",))
    if rig is None:
        raise ConfigError([campaign.locate.problem(("rig",), mapping.get("rig"), "no such file")])
    try:
        kinds: CampaignKind = kind_of(*rig).room("campaign").CAMPAIGNS
    except KindError:
        message = "rigs of this kind run sessions, which have no manual mode"
        raise ConfigError([rig.locate.problem(("kind",), rig.mapping["kind"], message)]) from None
    model = kinds.model(kinds.find_laws(campaign, rig), rig.mapping)
    columns = model.kind_columns.required(model.law_columns())
    row = ({column.key: 0.0 for column in columns}, "all gains zero")
    path.write_text(text_of_rows(file, path, name, [row]))
    return path
