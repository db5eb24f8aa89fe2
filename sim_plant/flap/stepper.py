"""Interpreted execution of the flap's step."""

from __future__ import annotations

from typing import Any, ClassVar

from sim_plant.bench import stepper
from sim_plant.flap import oswec


class Stepper(stepper.Stepper):
    """Interpreted stepper of the flap; its excitation is the moment of the waves."""

    plant: ClassVar[Any] = oswec
