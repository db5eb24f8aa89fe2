"""`rig show RUN`."""

import json
from pathlib import Path

from rig import cli
from rig.cli.failure import fail
from rig.cli.find_run import find_run


def main(named: Path, runs: Path, *, as_json: bool) -> int:
    """Print the summary of a run, worked out anew from its record."""
    from rig.analysis.report import summary_of
    from rig.analysis.summary import as_json as in_json
    from rig.analysis.summary import as_text

    try:
        summary = summary_of(find_run(named, runs))
    except (KeyError, ValueError, OSError) as error:
        return fail("show", error, as_json=as_json)
    print(json.dumps(in_json(summary)) if as_json else as_text(summary).rstrip())
    return cli.OK
