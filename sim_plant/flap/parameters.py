"""Schema of a flap's plant file: a bench without brake, with the flap in its place."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from sim_plant.bem import Bem
from sim_plant.bench.losses import DragParams
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.sections import Drag, SwitchValue
from sim_plant.entries import Entry, NonNegative, Positive, Stiffness, StrictModel
from sim_plant.flap import hydrodynamics
from sim_plant.flap.body import FlapBodyParams
from sim_plant.flap.oswec import FlapParams


class Flap(StrictModel):
    """The flap about its hinge."""

    coupled: Entry[SwitchValue, Literal["0 or 1"]]
    inertia: Entry[Positive, Literal["kg m2"]]
    added_inertia_infinite: Entry[NonNegative, Literal["kg m2"]]
    buoyancy: Entry[Stiffness, Literal["N m/rad"]]
    viscous_linear: Entry[NonNegative, Literal["N m s/rad"]]
    viscous_quadratic: Entry[NonNegative, Literal["N m s2/rad2"]]
    radiation_peak: Entry[Positive, Literal["N m s/rad"]]
    radiation_frequency: Entry[Positive, Literal["rad/s"]]
    radiation_width: Entry[Positive, Literal["rad/s"]]
    far_side: Drag


class Water(StrictModel):
    """The flume."""

    depth: Entry[Annotated[float, Field(gt=0.0, le=100.0)], Literal["m"]]
    onset: Entry[Annotated[float, Field(ge=0.0, le=100.0)], Literal["s"]]


class FlapPlant(BenchPlant):
    """A complete plant file of a flap on its driveline."""

    flap: Flap
    water: Water

    @model_validator(mode="after")
    def _check_no_brake(self) -> FlapPlant:
        if self.brake.fitted.value != 0:
            raise ValueError("brake.fitted must be 0: the flap replaces the brake")
        return self

    def build_flap(self) -> FlapParams:
        """Return the parameters of the step as floats."""
        file = self.flap
        width, centre = file.radiation_width.value, file.radiation_frequency.value
        far = file.far_side
        return FlapParams(
            self.build(),
            FlapBodyParams(
                float(file.inertia.value + file.added_inertia_infinite.value),
                float(file.buoyancy.value),
                float(file.viscous_linear.value),
                float(file.viscous_quadratic.value),
                float(file.radiation_peak.value * width),
                float(centre * centre),
                float(width),
            ),
            DragParams(
                float(far.clockwise.value), float(far.counter.value), float(far.viscous.value)
            ),
            file.coupled.value,
        )

    def coefficients(self) -> Bem:
        """Return added inertia, damping and excitation over frequency."""
        return hydrodynamics.coefficients(
            self.build_flap().body,
            float(self.flap.added_inertia_infinite.value),
            float(self.water.depth.value),
        )
