"""`python -m rig` runs the same command line as `rig`."""

import sys

INTERRUPTED = 3  # equals `rig.cli.output.STOPPED`, which may not be imported yet


def main() -> None:
    """Run the command line; an interrupt during its import also ends with a message."""
    try:
        from rig.cli.app import app  # noqa: PLC0415
    except KeyboardInterrupt:
        print("\nrig: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
    app()


if __name__ == "__main__":
    main()
