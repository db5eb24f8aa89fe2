"""The command line: one file per command; `rig.cli.app` lists them."""
