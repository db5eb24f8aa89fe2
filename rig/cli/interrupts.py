"""Ctrl-C in commands that do not handle it themselves."""

import sys
from typing import Any

from typer.core import TyperGroup

from rig.cli.options import STOPPED


class InterruptibleGroup(TyperGroup):
    """A group of commands that ends with a message on an unhandled Ctrl-C."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; exit with code 3 on an interrupt that the command did not handle."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            print(f"\nrig {ctx.invoked_subcommand}: interrupted", file=sys.stderr)
            sys.exit(STOPPED)
