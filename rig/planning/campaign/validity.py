"""Whether what was measured of a rig holds on the day on which a campaign runs on it."""

from datetime import date

from rig.config.problems import Problem
from rig.planning.campaign.files import Campaign
from rig.recording.calibration import At, OutsideError
from rig.recording.calibration.correction import holds


def out_of_date(campaign: Campaign, day: date) -> tuple[Problem, ...]:
    """What is told of the spring map that the positioner goes by, on a day in UTC.

    Nothing where the rig file has its own map, or where the calibration holds on that day. One that
    is valid by run number cannot be told for a run to come, and that is said.
    """
    known = campaign.rig.spring_map
    if known is None:
        return ()
    try:
        if holds(known.valid, At(day=day)):
            return ()
        why = f"does not hold on {day.isoformat()}: valid for {known.valid.description()}"
    except OutsideError as error:
        why = str(error)
    message = f"{known.title} {why}; the stator goes where it says all the same"
    return (campaign.rig_locate.problem(("spring_map", "valid"), None, message),)
