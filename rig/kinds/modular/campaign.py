"""The campaigns of a modular rig: the columns and laws of its axes, and the loop's set points."""

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any

from pydantic import Field

from controllers import signal_generator
from rig.campaign import CampaignKind
from rig.campaign.set_points import columns_of
from rig.config.campaign_file import BaseCampaignFile, RowOrder, with_laws
from rig.config.law_settings import IMPEDANCE, find_law, inherit_law
from rig.config.matrix import KindColumns
from rig.config.model import WholeNumber
from rig.kinds.modular.build import composition
from rig.kinds.modular.columns import axis_law
from rig.kinds.modular.config import LimitsFile, RigFile
from rig.kinds.modular.row_contents import signals
from rig.kinds.modular.tick import compose
from rig.kinds.modular.tick.composition import TRANSLATION
from rig.laws import Law
from rig.planning.input_files import ConfigSource
from rig.row_contents import CATEGORICAL, Column, X, Y


class CampaignFile(BaseCampaignFile):
    """A campaign of a modular rig; `law` is that of its axis, or a mapping by axis."""

    order: RowOrder = "as given"


_OTHERS = (
    Column("reference_scale", "reference_scale", "1", "reference scale",
           field="reference.scale", tolerance=0.005),
    Column("realisation", "realisation", "1", "realisation", CATEGORICAL),
)  # fmt: skip
_TYPES = {
    "reference_scale": Annotated[float, Field(ge=-10, le=10)],
    "realisation": Annotated[WholeNumber, Field(ge=1, le=100)],
}
COLUMNS = KindColumns(first=None, others=_OTHERS, types=_TYPES, law_details={})
"""The columns of every modular rig besides those of its laws."""

_Motions = tuple[tuple[str, str], ...]  # name and motion of each axis


def axis_motions(rig: Mapping[str, Any]) -> _Motions:
    """Return the axes of a rig file as read, which need not be valid."""
    axes = rig.get("axes")
    named = axes.items() if isinstance(axes, dict) else ()
    motions = tuple(
        (str(name), str(each.get("motion")) if isinstance(each, dict) else TRANSLATION)
        for name, each in named
    )
    return motions or (("heave", TRANSLATION),)


def _axes(rig: dict[str, Any]) -> tuple[str, ...]:
    return tuple(name for name, _ in axis_motions(rig))


def _find_laws(campaign: ConfigSource, rig: ConfigSource | None) -> dict[str, Law]:
    """Return the law of each axis; the rig file has those that the campaign does not name."""
    names = _axes({} if rig is None else rig.mapping)
    several = len(names) > 1
    if rig is not None:
        if several:
            campaign.mapping.setdefault("law", {})
        for name in names:
            key = ("law", name) if several else ("law",)
            inherit_law(*campaign, *rig, ("axes", name, "law"), key)
    given = campaign.mapping.get("law")
    if not several:
        return {names[0]: find_law(given, campaign.locate, COLUMNS)}
    by_axis = given if isinstance(given, dict) else {}
    return {
        name: find_law(by_axis.get(name), campaign.locate, COLUMNS, ("law", name)) for name in names
    }


@cache
def _model(motions: _Motions, axis_laws: tuple[Law, ...]) -> type[CampaignFile]:
    """Return the model of a campaign for the axes and laws of a rig."""
    several = len(motions) > 1
    by_axis = {
        name: axis_law(law, name if several else "", rotates=motion != TRANSLATION)
        for (name, motion), law in zip(motions, axis_laws, strict=True)
    }
    details: dict[str, Any] = {}
    for place, (name, each) in enumerate(by_axis.items()):
        if not any(law.module is IMPEDANCE.module for law in each.law.members):
            continue
        by_key = dict(zip((c.key for c in each.law.columns), each.columns, strict=True))
        kp, ki, km = (by_key[column.key] for column in IMPEDANCE.columns)
        details |= {
            kp.key: {"field": f"{name}.demand.kp", "tolerance": 25.0},
            ki.key: {"field": f"{name}.demand.ki", "tolerance": 25.0},
            km.key: {"field": f"{name}.demand.km", "tolerance": 1.0},
        }
        if place == 0:
            details[kp.key]["role"], details[ki.key]["role"] = Y, X
    own = KindColumns(first=None, others=_OTHERS, types=_TYPES, law_details=details)
    return with_laws(CampaignFile, own, tuple(by_axis.items()))


def _defaults(file: CampaignFile, rig: RigFile) -> dict[str, float]:
    realisation = getattr(file.reference, "realisation", 1) if file.reference else 0
    return {"reference_scale": 1.0, "realisation": float(realisation)}


def _set_points(file: CampaignFile, rig: RigFile, settings: tuple[Any, ...]) -> Any:
    """Return the composed `Setpoints`: the columns of each axis's law, and the reference."""
    columns = columns_of(settings)
    composed = compose(composition(rig, {n: each.law for n, each in file.axis_laws.items()}))
    return composed.Setpoints(
        **{
            name: tuple(columns[column.name] for column in each.columns)
            for name, each in file.axis_laws.items()
        },
        reference_scale=columns["reference_scale"],
        realisation=tuple(int(number) for number in columns["realisation"]),
        signal=signal_generator.columns(len(settings)),
    )


CAMPAIGNS = CampaignKind(
    rig_file=RigFile,
    limits_file=LimitsFile,
    campaign_file=CampaignFile,
    axes=_axes,
    find_laws=_find_laws,
    model=lambda laws, rig: _model(axis_motions(rig), tuple(laws.values())),
    gain_ramp=lambda rig, axis: rig.axes[axis].gain_ramp_s,
    set_points=_set_points,
    defaults=_defaults,
    assessed_stations=lambda rig: rig.power_stations,
    signals=signals,
)
