"""Rules for every command of `rig`."""

from collections.abc import Iterator

import pytest
from command_here import rig
from rich.text import Text
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from rig.cli.app import COMMANDS, app, load
from rig.kinds import registry


def commands(command: object, name: str) -> Iterator[tuple[str, TyperCommand]]:
    if isinstance(command, TyperGroup):
        for subcommand, each in command.commands.items():
            yield from commands(each, f"{name} {subcommand}")
    elif isinstance(command, TyperCommand):
        yield name, command


LISTED = (*COMMANDS, *registry.commands())
ALL = dict(pair for each in LISTED for pair in commands(load(each), f"rig {each.name}"))


def test_all_commands_are_listed() -> None:
    assert len(ALL) > 20
    own = {"rig run", "rig check", "rig scan modbus", "rig new kind"}
    assert own | {"rig bench", "rig twin", "rig new rig"} <= set(ALL)
    group = get_command(app)
    assert isinstance(group, TyperGroup)
    listed = group.list_commands(group.make_context("rig", ["runs"]))
    assert listed == [each.name for each in LISTED if " " not in each.name]  # no group's command
    assert len({each.name for each in LISTED}) == len(LISTED)
    assert all(each.help for each in LISTED)


@pytest.mark.parametrize("name", ALL)
def test_a_command_has_json_and_help_for_every_option(name: str) -> None:
    options = {flag: option for option in ALL[name].params for flag in option.opts}
    assert "--json" in options
    assert [flag for flag, option in options.items() if not getattr(option, "help", "")] == []
    assert ALL[name].help
    assert not {"--install-completion", "--show-completion"} & set(options)
    for text in (ALL[name].help, *(getattr(each, "help", "") for each in ALL[name].params)):
        assert Text.from_markup(text).plain == text.replace("\\[", "[")  # no part is read as markup


@pytest.mark.parametrize("command", [(), ("run",), ("scan",), ("scan", "can"), ("matrix",)])
def test_short_option_of_help(command: tuple[str, ...]) -> None:
    """Of the core's commands, of a group, and of a kind of rig."""
    short, long = rig(*command, "-h"), rig(*command, "--help")
    assert short.returncode == long.returncode == 0
    assert short.stdout == long.stdout
    assert f"Usage: {' '.join(('rig', *command))} " in short.stdout


def test_help_of_a_group_has_its_commands_and_texts() -> None:
    """That of a kind, too, and no options of shells."""
    shown = rig("new", "--help").stdout
    assert "Write a kind of rig as a package of its own" in shown
    assert "Write rig, limits, plant and campaign file" in shown
    assert "completion" not in shown
    assert "Name of the kind: [a-z][a-z0-9_]*." in rig("new", "kind", "--help").stdout
    assert "completion" not in rig("scan", "--help").stdout
