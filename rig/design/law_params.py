"""The constants of a law, from its settings in a campaign file."""

from typing import Any

from controllers.biquads import Biquad
from rig.config.law_settings import IMPEDANCE, LawSettings
from rig.design.impedance import design as design_zc
from rig.laws import Law


def law_params(law: Law, settings: LawSettings, ramp: float, dt: float) -> Any:
    """Return the Params of a law for a gain ramp and a period (s).

    Raises ValueError for settings that do not fit together.
    """
    params = law.module.params(settings.values(law.parameters), ramp, dt)
    if law.module is not IMPEDANCE.module:
        return params
    return params._replace(sections=zc_sections(settings, dt))


def zc_sections(settings: LawSettings, dt: float) -> tuple[Biquad, ...]:
    """Return Z_c(s) as biquads for a period ``dt`` (s); ValueError if invalid.

    It is empty for a law without Z_c.
    """
    zc = getattr(settings, "zc", None)
    return () if zc is None else design_zc(zc.numerator, zc.denominator, dt)
