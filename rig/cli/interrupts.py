"""What Ctrl-C does to a command that does not heed it itself."""

import sys
from typing import Any

from typer.core import TyperGroup

from rig.cli.options import STOPPED


class Interruptible(TyperGroup):
    """The commands; Ctrl-C before or after what heeds it itself ends them with a word."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; exit code 3 for an interrupt that nothing in it took."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            print(f"\nrig {ctx.invoked_subcommand}: interrupted", file=sys.stderr)
            sys.exit(STOPPED)
