"""Validity of a rig's measured spring map on the day of a campaign."""

from datetime import date

from rig.campaign import AnyCampaign
from rig.config.problems import Problem
from rig.recording.calibration import RecordingTime, ValidityError, is_valid


def validity_warnings(campaign: AnyCampaign, day: date) -> tuple[Problem, ...]:
    """Return a warning if the calibration of the spring map is not valid on a day (UTC).

    The result is empty if the rig file has its own map or if the calibration is valid. The
    validity of a calibration by run number is unknown before the run, which also gives a warning.
    """
    spring_map = campaign.rig.spring_map
    if spring_map is None:
        return ()
    try:
        if is_valid(spring_map.valid, RecordingTime(day=day)):
            return ()
        reason = f"does not hold on {day.isoformat()}: valid for {spring_map.valid.description()}"
    except ValidityError as error:
        reason = str(error)
    message = f"{spring_map.title} {reason}; the stator is nevertheless positioned by this map"
    return (campaign.rig_locate.problem(("spring_map", "valid"), None, message),)
