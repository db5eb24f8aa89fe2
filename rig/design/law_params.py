"""The constants of an axis's law, from its settings in a campaign file."""

import re
from typing import Any

from controllers.biquads import Biquad
from rig.config.law_settings import IMPEDANCE, LawSettings
from rig.design.impedance import design as design_zc
from rig.laws import Law
from rig.plug_ins import error_text


def law_params(law: Law, settings: LawSettings, ramp: float, dt: float) -> Any:
    """Return the Params of an axis's law for a gain ramp and a period (s).

    Raises ValueError for settings that do not fit together; the message has the keys of the file.
    """
    try:
        params = law.module.params(settings.values(law), ramp, dt)
    except ValueError as error:
        keys = settings.law_keys(law)
        raise ValueError(
            re.sub(r"\w+", lambda name: keys.get(name[0], name[0]), str(error))
        ) from error
    except Exception as error:  # a law of people may raise anything
        text = error_text(error, law.path)
        raise ValueError(f"params of the law {law.name} raised an exception: {text}") from error
    if law.module is not IMPEDANCE.module:
        return params
    return params._replace(sections=zc_sections(settings, dt))


def zc_sections(settings: LawSettings, dt: float) -> tuple[Biquad, ...]:
    """Return Z_c(s) as biquads for a period ``dt`` (s); ValueError if invalid.

    It is empty for a law without Z_c.
    """
    zc = getattr(settings, "zc", None)
    return () if zc is None else design_zc(zc.numerator, zc.denominator, dt)
