"""`python -m rig`: the same as the command `rig`."""

import sys

INTERRUPTED = 3  # as `rig.cli.STOPPED`, which may not be there yet


def main() -> None:
    """The command line; an interrupt while it is still being loaded ends it with a word, too."""
    try:
        from rig.cli import app  # noqa: PLC0415
    except KeyboardInterrupt:
        print("\nrig: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
    app()


if __name__ == "__main__":
    main()
