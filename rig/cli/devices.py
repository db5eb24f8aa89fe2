"""`rig devices RIG`."""

import json
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Group

from rig import cli
from rig.cli import bench_devices_view
from rig.cli.command_error import fail
from rig.cli.console import table_console
from rig.cli.devices_view import as_dict, heard_as_dict, render, render_heard
from rig.cli.file_problems import INPUT_ERRORS, refuse
from rig.cli.input_files import RIGS, input_file
from rig.config.rig_file import BaseRigFile
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.hardware.job import build_bench_job
from rig.kinds.oswec_bench.hardware.survey import survey_bench
from rig.kinds.rig_file import load_rig
from rig.kinds.wavebot.hardware.job import build_job
from rig.recording.runs.create import BusyError
from rig.wires import locks as wire_locks
from rig.wires.can_survey import survey
from rig.wires.listen import listen


def main(path: Path, *, only_listen: bool, objects: bool, as_json: bool) -> int:
    """Survey every wire of a rig, print the result, and return the exit code.

    The code is 0 if all devices answer and agree with the rig file.
    """
    try:
        rig, _, _ = load_rig(input_file(path, RIGS))
        survey_wires = (
            _bench_survey(rig) if isinstance(rig, BenchRigFile) else _wavebot_survey(rig, objects)
        )
    except INPUT_ERRORS as error:
        return refuse("devices", error, as_json=as_json)
    with ExitStack() as locks:
        if only_listen:
            survey_wires = _passive_survey(rig)
        else:
            try:
                locks.enter_context(wire_locks.acquire(wire_locks.wires_in(rig), "rig devices"))
            except BusyError as error:
                text = f"{error}\n--listen sends nothing: it shows what nodes on the CAN bus send"
                return fail("devices", RuntimeError(text), as_json=as_json, code=cli.FAILED)
        console = table_console()
        if not as_json and console.is_terminal:
            with console.status("surveying the rig's wires ..."):
                survey_output = survey_wires()
        else:
            survey_output = survey_wires()
    if as_json:
        print(json.dumps(survey_output.data, ensure_ascii=False))
    else:
        console.print(survey_output.rendered)
    return cli.FAILED if survey_output.trouble else cli.OK


class _SurveyOutput(NamedTuple):
    """A survey for programs (``data``) and for people (``rendered``), and its troubles."""

    data: dict[str, Any]
    rendered: Group
    trouble: tuple[str, ...]


def _wavebot_survey(rig: Any, objects: bool) -> Callable[[], _SurveyOutput]:
    job = build_job(rig)

    def run_survey() -> _SurveyOutput:
        result = survey(job)
        rendered = render(rig.name, result, all_objects=objects)
        return _SurveyOutput(as_dict(rig.name, result), rendered, result.trouble)

    return run_survey


def _bench_survey(rig: BenchRigFile) -> Callable[[], _SurveyOutput]:
    job = build_bench_job(rig)

    def run_survey() -> _SurveyOutput:
        result = survey_bench(job)
        data = bench_devices_view.as_dict(rig.name, result)
        rendered = bench_devices_view.render(rig.name, result)
        return _SurveyOutput(data, rendered, result.trouble)

    return run_survey


def _passive_survey(rig: BaseRigFile) -> Callable[[], _SurveyOutput]:
    def run_survey() -> _SurveyOutput:
        heard = listen(rig)
        return _SurveyOutput(
            heard_as_dict(rig.name, heard), render_heard(rig.name, heard), heard.trouble
        )

    return run_survey
