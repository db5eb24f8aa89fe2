"""`rig show RUN`."""

import json
import sys
from pathlib import Path

from rig import cli
from rig.cli.find_run import find_run
from rig.runs import RunError


def main(named: Path, runs: Path, *, as_json: bool) -> int:
    """Print the summary of a run, worked out anew from its record."""
    from rig.analysis.report import summary_of
    from rig.analysis.summary import as_json as in_json
    from rig.analysis.summary import as_text

    try:
        summary = summary_of(find_run(named, runs))
    except (RunError, KeyError) as error:
        print(f"rig show: {error}", file=sys.stderr)
        return cli.BAD_INPUT
    print(json.dumps(in_json(summary)) if as_json else as_text(summary).rstrip())
    return cli.OK
