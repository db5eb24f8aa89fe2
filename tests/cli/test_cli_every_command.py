"""What holds for every command, those to come included."""

from collections.abc import Iterator

import pytest
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from rig.cli import app


def commands(of: object, name: str = "rig") -> Iterator[tuple[str, TyperCommand]]:
    if isinstance(of, TyperGroup):
        for word, each in of.commands.items():
            yield from commands(each, f"{name} {word}")
    elif isinstance(of, TyperCommand):
        yield name, of


ALL = dict(commands(get_command(app)))


def test_the_walk_finds_them() -> None:
    assert len(ALL) > 20
    assert {"rig run", "rig check", "rig scan modbus"} <= set(ALL)


@pytest.mark.parametrize("name", ALL)
def test_it_takes_json_and_explains_every_option(name: str) -> None:
    options = {word: each for each in ALL[name].params for word in each.opts}
    assert "--json" in options
    assert [word for word, each in options.items() if not getattr(each, "help", "")] == []
    assert ALL[name].help
