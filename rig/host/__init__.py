"""Examination of a host: is it fit for real time on a rig, or for a rehearsal (`rig doctor`)."""

from rig.host.examination import DoctorOptions, Examination, examine
from rig.host.finding import Finding, Host, Use, Verdict

__all__ = ["DoctorOptions", "Examination", "Finding", "Host", "Use", "Verdict", "examine"]
