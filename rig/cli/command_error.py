"""Error reports of the commands."""

import json
import sys

from rig import cli


def error_text(error: Exception) -> str:
    """Return an error's text, without the quotes of a KeyError or the number of an OSError."""
    if isinstance(error, KeyError) and error.args:
        return str(error.args[0])
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)


def fail(command: str, error: Exception, *, as_json: bool, code: int = cli.BAD_INPUT) -> int:
    """Print an error on standard error, or as JSON on standard output; return ``code``."""
    message = error_text(error) or type(error).__name__
    if as_json:
        status = "bad input" if code == cli.BAD_INPUT else "failed"
        print(json.dumps({"status": status, "message": message}))
    else:
        print(f"rig {command}: {message}", file=sys.stderr)
    return code
