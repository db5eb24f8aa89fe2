"""The command `rig`: a table of its commands, whose modules are imported when they are used."""

import os
import sys

# Before numpy is imported, here and in all processes of a run. The matrices are small: further
# threads of BLAS cost half a second of waiting for each other, and their number would change the
# last bits of results, so that these depended on the host.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from rig.cli.output import STOPPED
from rig.cli.stop_signals import repeated_interrupts
from rig.kinds import registry
from rig.kinds.registry import Command

COMMANDS = tuple(
    Command(name, f"rig.cli.{name}", text)
    for name, text in (
        ("run", "Run a campaign or session, and analyse it."),
        ("manual", "Run a rig in manual mode: people choose gains and signals while it runs."),
        ("request", "Ask something of a running run: stop, hold, skip, set, annotate ..."),
        ("page", "Serve the operator's page of a running run, or replay a recorded one."),
        ("check", "Check a campaign or session: list every error, or describe the planned run."),
        ("compile", "Compile the tick of a campaign or session ahead of its runs."),
        ("sim", "Emulate the devices of a wired rig, at the addresses of its rig file."),
        ("faults", "Rehearse faults of a rig's emulated devices; compare its reactions."),
        ("devices", "List the devices that answer on a rig's wires, and check their settings."),
        ("home", "Home the actuators of a rig, outside a run."),
        ("doctor", "Check whether this host is fit for real time on a rig; give advice if not."),
        ("recover", "Finish the record of a run that was killed, and list the missing ticks."),
        ("campaigns", "List the shipped campaigns, sessions and rigs."),
        ("copy", "Copy a shipped campaign, session or rig, and all its files, for editing."),
        ("new", "Write a new kind of rig as a package, or the files of a new rig."),
        ("plant", "Write the files of simulated plants: from BEM coefficients."),
        ("runs", "List all runs, newest first."),
        ("laws", "List the control laws: columns of the matrix, parameters, ranges."),
        ("kinds", "List the kinds of rig, with origin and version."),
        ("show", "Show how a run went and the summary of its results."),
        ("plot", "Draw a run: its products, one surface, bars, or log fields over time."),
        ("compare", "Compare two runs of one matrix: settings, then power point by point."),
        ("identify", "Identify impedances and wave excitation from open-loop runs."),
        ("replay", "Replay a run's logged sensors through today's cycle, and compare."),
        ("sweep", "Simulate a campaign or session for all values of some parameters."),
        ("optimum", "Find the best set points of a campaign on its simulated plant."),
        ("export", "Export a run for other tools."),
        ("merge", "Align wave data, power-analyser and other records with a run's time."),
        ("calibration", "List, show, apply and compare versioned corrections of recorded values."),
        ("scan", "List the devices on a wire without a rig file. It only reads."),
    )
)
"""The commands of the core, with their help in the list; each has more by its own `--help`."""


class CommandGroup(TyperGroup):
    """The commands of core and kinds of rig, for `--help` known by name and help alone."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self._listed: dict[str, Command] = {}
        self._add(COMMANDS)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        self._add(registry.commands())
        return super().list_commands(ctx)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command without its options; None for an unknown name."""
        if cmd_name not in self.commands:
            self._add(registry.commands())
        return super().get_command(ctx, cmd_name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return name, command with its options, and the remaining arguments."""
        name, _, rest = super().resolve_command(ctx, args)
        return name, name and load(self._listed[name]), rest

    def invoke(self, ctx: Any) -> Any:
        """Run the command and exit with its code; 3 on an interrupt that it did not handle."""
        try:
            with repeated_interrupts():
                code = super().invoke(ctx)
        except KeyboardInterrupt:
            name = " ".join(filter(None, ("rig", ctx.invoked_subcommand)))  # none: during import
            print(f"\n{name}: interrupted", file=sys.stderr)
            code = STOPPED
        sys.exit(code)

    def _add(self, commands: tuple[Command, ...]) -> None:
        for each in commands:
            if " " in each.name:
                continue  # of a group, which adds it when it is loaded
            self._listed.setdefault(each.name, each)
            self.commands.setdefault(each.name, TyperCommand(each.name, help=each.help))


def load(listed: Command) -> Any:
    """Return a command with its options: a function `command` of a module, or a group of some.

    A group has its own commands, and those of kinds whose name begins with that of the group.
    """
    module = import_module(listed.module)
    if isinstance(module.command, typer.Typer):
        group: Any = typer.main.get_group(module.command)  # without options of shells
        group.name, group.help = listed.name, listed.help
        for each in registry.commands():
            if each.name.startswith(f"{listed.name} "):
                group.add_command(load(each))
        return group
    single = typer.Typer(add_completion=False)
    single.command(listed.name.split()[-1], epilog=getattr(module, "EXIT_CODES", None))(
        module.command
    )
    return typer.main.get_command(single)


app = typer.Typer(
    name="rig",
    cls=CommandGroup,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["--help", "-h"]},  # also of all commands
)


def _print_version(value: bool) -> None:
    if value:
        from rig.recording.provenance import code_text, describe_code

        print(f"wec-rig {code_text(describe_code())}")
        raise typer.Exit


@app.callback()
def rig(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_print_version,
            is_eager=True,
            help="Print version, commit and Python, and exit.",
        ),
    ] = False,
) -> None:
    """Run wave-energy test rigs: campaigns, rehearsals, and the analysis of their results."""
