"""Survey of all wires of a rig: the devices that answer, and what they report. It only reads."""

from collections.abc import Iterator
from typing import NamedTuple

from rig.wires.can_survey import BusSurvey, bus_troubles, survey_bus
from rig.wires.job import WiredJob
from rig.wires.line_survey import LineSurvey, survey_line, unit_troubles
from rig.wires.stream_survey import StreamSurvey, survey_stream


class RigSurvey(NamedTuple):
    """The survey of all wires of a rig."""

    can: BusSurvey | None  # None: the rig has no CAN bus
    streams: tuple[StreamSurvey, ...]
    lines: tuple[LineSurvey, ...]

    @property
    def trouble(self) -> tuple[str, ...]:
        """Every device that does not answer or differs from the rig file; empty: none."""
        return tuple(self._trouble())

    def _trouble(self) -> Iterator[str]:
        if self.can is not None:
            yield from bus_troubles(self.can)
        for stream in self.streams:
            if stream.trouble:
                yield f"{stream.name} at {stream.address}: {stream.trouble}"
        for line in self.lines:
            yield from unit_troubles(line)


def survey(job: WiredJob) -> RigSurvey:
    """Survey every wire of a job; a wire out of reach is reported, no error is raised."""
    can = None
    streams = [survey_stream(kind, settings) for kind, settings in job.loop_streams.items()]
    lines = []
    for process in job.io_processes:
        match process.module.rpartition(".")[2]:
            case "can_service":
                can = survey_bus(process.config, job.bus_load.total if job.bus_load else 0.0)
            case "stream_poller":
                config = process.config
                found = survey_stream(config["kind"], config["settings"])
                streams.append(found._replace(name=config["name"]))
            case "modbus_poller":
                lines.append(survey_line(process.name.removeprefix("line "), process.config))
    return RigSurvey(can, tuple(streams), tuple(lines))
