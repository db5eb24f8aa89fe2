"""Survey of an EtherCAT segment: the slaves that answer, and their settings.

It brings the slaves to PRE-OP to read their objects, and leaves them in INIT. It writes no object.
"""

from collections.abc import Sequence
from contextlib import closing
from typing import Any, NamedTuple

from drivers.cia402 import arming, error_codes, statusword
from drivers.cia402.arming import Mismatch, SetupStep
from drivers.errors import LinkError, ServiceError
from drivers.ethercat.service import Service, SlaveIdentity
from rig.wires.segment_service import identity_problems

_STATUSWORD, _ERROR_CODE = 0x6041, 0x603F


class SlaveSurvey(NamedTuple):
    """The survey of one slave of the line; None for values that it does not have."""

    name: str  # in the rig file; empty: the rig file has no slave at this place
    place: int  # from 1
    vendor: int
    product: int
    revision: int
    device: str  # as it reports itself
    statusword: int | None = None  # of a drive
    error_code: int | None = None  # of a drive
    checked: int = 0  # number of compared objects
    wrong: tuple[Mismatch, ...] = ()  # objects that no run writes: a run would be refused
    unset: tuple[Mismatch, ...] = ()  # objects that every run writes before it arms
    trouble: tuple[str, ...] = ()


class SegmentSurvey(NamedTuple):
    """The survey of a segment."""

    interface: str
    trouble: tuple[str, ...]  # of the whole line
    slaves: tuple[SlaveSurvey, ...]


def find_slaves(interface: str) -> tuple[SlaveIdentity, ...]:
    """Return the slaves of an interface in the order of the line.

    ServiceError or LinkError without any.
    """
    with closing(Service(interface)) as service:
        return service.find()


def survey_segment(config: dict[str, Any]) -> SegmentSurvey:
    """Survey a segment; ``config`` is that of its service process."""
    interface, expected = config["interface"], config["slaves"]
    try:
        with closing(Service(interface)) as service:
            found = service.find()
            problems = identity_problems(found, expected)
            surveyed = tuple(
                _survey_slave(service, place, identity, expected, readable=not problems)
                for place, identity in enumerate(found)
            )
    except (LinkError, ServiceError) as error:
        return SegmentSurvey(interface, (str(error),), ())
    return SegmentSurvey(interface, tuple(problems), surveyed)


def _survey_slave(
    service: Service,
    at: int,
    identity: SlaveIdentity,
    expected: Sequence[dict[str, Any]],
    *,
    readable: bool,
) -> SlaveSurvey:
    """Read a slave's objects; in a line that is another one only its identity counts."""
    name = expected[at]["name"] if at < len(expected) else ""
    survey = SlaveSurvey(
        name, at + 1, identity.vendor, identity.product, identity.revision, identity.name
    )
    if not readable or not expected[at]["steps"]:
        return survey
    steps = tuple(SetupStep(*step) for step in expected[at]["steps"])
    present = arming.compare_present(
        steps, lambda step: service.read(at, step.object, step.sub, step.type)
    )
    status = code = None
    trouble = [*arming.format_mismatches(present.wrong).splitlines()]
    trouble += [
        f"has no object {each.object:#06x}:{each.sub:02x}, {each.name}"
        for each in present.unset
        if each.actual is None
    ]
    if expected[at]["watchdog_ms"] and any(s.object == 0x6007 for s in steps):  # a drive
        status = service.read(at, _STATUSWORD, 0, "u16")
        code = service.read(at, _ERROR_CODE, 0, "u16")
        if status is None:
            trouble.append("gives no statusword 0x6041")
        elif code:
            trouble.append(f"reports error {code:#06x}, {error_codes.meaning(code)}")
        elif statusword.decode(status) in (statusword.FAULT, statusword.FAULT_REACTION):
            trouble.append(f"is in fault: {statusword.describe(status)}")
    trouble += [
        f"does not give {fact}, without which its command has no scale"
        for fact, index, sub, kind in expected[at]["facts"]
        if service.read(at, index, sub, kind) is None
    ]
    return survey._replace(
        statusword=status,
        error_code=code,
        **present._asdict(),
        trouble=tuple(trouble),
    )
