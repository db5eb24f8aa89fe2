"""The linear form of a heave law, as gains of the impedance law: predictions need nothing else.

A law other than the impedance law is predicted if its `linear` is a damper, a spring and a mass:

    F / v = Kp + Ki / (j omega) + Km j omega

with the same gains at every frequency. Then the loop's stability is exact, too.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from controllers.signals import Gains
from rig.config.campaign_file import CampaignFile
from rig.kinds.wavebot.law_params import law_params
from rig.planning.campaign.set_points import RowSetting

_OMEGA = np.linspace(0.3, 13.0, 9)  # rad/s, of waves of 0.05 .. 2 Hz
_TOLERANCE = 1e-9  # of the greatest force per velocity


class NotLinearError(ValueError):
    """A law that has no linear form of constant gains; the message is the reason."""


def row_gains(campaign: CampaignFile, setting: RowSetting, ramp: float, dt: float) -> Gains:
    """Return the gains of a row's set point; NotLinearError if its law has none.

    ``ramp`` and ``dt`` (s) are those of the rig, for the law's constants.
    """
    law = campaign.heave_law
    if campaign.zc_law is not None:
        return Gains(setting.kp, setting.ki, setting.km)
    if law.linear is None:
        raise NotLinearError(f"the law {law.name} has no linear form")
    set_point = law.module.SetPoint(*(getattr(setting, one.name) for one in law.columns))
    params: Any = law_params(law, campaign.law, ramp, dt)
    response = np.array([law.linear(params, set_point, float(omega)) for omega in _OMEGA])
    kp = float(response.real.mean())
    system = np.column_stack([-1.0 / _OMEGA, _OMEGA])
    (ki, km), *_ = np.linalg.lstsq(system, response.imag, rcond=None)
    fitted = kp + 1j * (system @ np.array([ki, km]))
    if not np.abs(fitted - response).max() <= _TOLERANCE * max(1.0, np.abs(response).max()):
        raise NotLinearError(
            f"the linear form of the law {law.name} is not that of a damper, a spring and a mass"
        )
    return Gains(kp, float(ki), float(km))


def missing_reason(campaign: CampaignFile, setting: RowSetting, ramp: float, dt: float) -> str:
    """Return why the rows of a campaign cannot be predicted; empty if they can."""
    try:
        row_gains(campaign, setting, ramp, dt)
    except NotLinearError as error:
        return str(error)
    return ""
