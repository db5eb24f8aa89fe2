"""`python -m rig`: the same as the command `rig`."""

from rig.cli import app

app()
