"""The linear WaveBot as a two-port, with the oracle's impedance and BEM excitation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from closed_form import intrinsic_impedance
from twoport_optimum import Device, Drive, Sea

from rig.config.yaml_source import load_mapping
from rig.kinds.wavebot.twin.two_port import MOTOR
from sim_plant.bem import Bem, excitation_at, read_bem
from sim_plant.parameters import Plant
from sim_plant.wavebot import WaveBotParams

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def plant() -> tuple[WaveBotParams, Bem]:
    mapping, _ = load_mapping(CONFIGS / "plants" / "wavebot_linear.yaml")
    file = Plant.model_validate(mapping)
    return file.build(), read_bem(CONFIGS / "plants" / file.bem)


PARAMS, BEM = plant()


def sea(f_hz: Any, amplitude: Any) -> Sea:
    f = np.atleast_1d(np.asarray(f_hz, dtype=float))
    return Sea(2.0 * np.pi * f, np.conj(excitation_at(BEM, f)) * amplitude)


def device(incident_sea: Sea, loop: Any = None) -> Device:
    z_i = intrinsic_impedance(PARAMS, incident_sea.omega / (2.0 * np.pi))
    return Device(z_i, 0.0, PARAMS.pto.viscous, MOTOR, PARAMS.body.hydrostatic, loop)


def drive() -> Drive:
    cots = PARAMS.electrics.cots
    ampere = PARAMS.pto.force_per_current
    return Drive(cots.fixed_loss, cots.linear_loss, cots.square_loss, ampere)
