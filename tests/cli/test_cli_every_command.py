"""Rules for every command of `rig`."""

from collections.abc import Iterator

import pytest
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
    assert {"rig run", "rig check", "rig scan modbus", "rig bench", "rig twin"} <= set(ALL)
    group = get_command(app)
    assert isinstance(group, TyperGroup)
    listed = group.list_commands(group.make_context("rig", ["runs"]))
    assert listed == [each.name for each in LISTED]
    assert len({each.name for each in LISTED}) == len(LISTED)
    assert all(each.help for each in LISTED)


@pytest.mark.parametrize("name", ALL)
def test_a_command_has_json_and_help_for_every_option(name: str) -> None:
    options = {flag: option for option in ALL[name].params for flag in option.opts}
    assert "--json" in options
    assert [flag for flag, option in options.items() if not getattr(option, "help", "")] == []
    assert ALL[name].help
