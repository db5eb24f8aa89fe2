"""`python -m rig` runs the same command line as `rig`."""

import gc
import sys

INTERRUPTED = 3  # equals `rig.cli.output.STOPPED`, which may not be imported yet


def main() -> None:
    """Run the command line; an interrupt during its import also ends with a message."""
    # Imported modules are no garbage: to look among their objects for some every 700 new ones takes
    # a tenth of the time of a command.
    gc.set_threshold(200_000)
    try:
        from rig.cli.app import app  # noqa: PLC0415
    except KeyboardInterrupt:
        print("\nrig: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
    try:
        app()
    finally:
        gc.freeze()  # nor at the end of the process


if __name__ == "__main__":
    main()
