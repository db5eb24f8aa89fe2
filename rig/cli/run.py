"""`rig run CAMPAIGN`."""

import json
import sys
from pathlib import Path
from typing import Any

from rig import cli
from rig.campaign_run import Ended, rehearse
from rig.cli.check import complain, examine
from rig.cli.progress import Progress
from rig.runs import RunError, create
from rig.runs.folder import STATUS

_CODES = {"complete": cli.OK, "stopped": cli.STOPPED, "fault": cli.FAULT}


def main(path: Path, runs: Path, *, realtime: bool, as_json: bool) -> int:
    """Check, run, analyse, and say how it went; gives the exit code."""
    report = examine(path)
    if report.campaign is None or report.plan is None:
        return complain(report, as_json=as_json)
    campaign, plan = report.campaign, report.plan
    title = f"{campaign.file.name} on {campaign.rig.name}"
    try:
        with Progress(title, "rehearsal", plan, quiet=as_json) as view:
            ended = rehearse(campaign, plan, runs, view, real_clock=realtime)
    except (create.BusyError, OSError, RunError) as error:
        return _failed(str(error), as_json=as_json)
    products, trouble = _analyse(ended, quiet=as_json)
    trouble = "; ".join(filter(None, (ended.trouble, trouble)))
    outcome = ended.outcome
    if as_json:
        print(
            json.dumps(
                {
                    **outcome._asdict(),
                    "folder": str(ended.folder),
                    "products": [str(product) for product in products],
                    "trouble": trouble,
                }
            )
        )
    else:
        _tell(ended, products, trouble)
    if outcome.status in ("crashed", "refused") or outcome.dropped or outcome.unsaved:
        return cli.LOST
    if trouble:
        return cli.FAILED
    return _CODES[outcome.status]


def _failed(message: str, *, as_json: bool) -> int:
    if as_json:
        print(json.dumps({"status": "failed", "message": message}))
    else:
        print(f"rig run: {message}", file=sys.stderr)
    return cli.FAILED


def _analyse(ended: Ended, *, quiet: bool) -> tuple[list[Path], str]:
    """The run's products and, if they could not be made, why."""
    from rig.analysis.report import write_products

    if not quiet:
        print("drawing surfaces and summary ...", file=sys.stderr, flush=True)
    try:
        products = write_products(ended.folder)
    except (RunError, OSError, ValueError) as error:
        return [], f"no products: {error}"
    except KeyboardInterrupt:
        return [], f"interrupted; `rig plot {ended.folder}` makes surfaces and summary"
    summary: dict[str, Any] = json.loads((ended.folder / "summary.json").read_text())
    status = json.loads((ended.folder / STATUS).read_text())
    status["rows_done"] = summary["rows_done"]
    create.write_json(ended.folder, STATUS, status)
    return products, ""


def _tell(ended: Ended, products: list[Path], trouble: str) -> None:
    text = ended.folder / "summary.txt"
    if text.exists():
        print(text.read_text().rstrip())
    outcome = ended.outcome
    if outcome.status in ("crashed", "refused"):
        print(f"\n{outcome.status}: {outcome.reason}", file=sys.stderr)
    if outcome.dropped or outcome.unsaved:
        lost = f"{outcome.dropped} rows dropped, {outcome.unsaved} rows not saved"
        print(f"\nlost: {lost}", file=sys.stderr)
    if trouble:
        print(f"\n{trouble}", file=sys.stderr)
    print(f"\n{ended.folder}/")
    for product in products:
        print(f"  {product.name}")
