"""File of a fitted radiation, next to a plant: a fit of several modes takes longer than a load.

It holds a fingerprint of the coefficients that it was fitted to; others make it stale.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from sim_plant.bem import open_regular_file
from sim_plant.modes.bem import BemModes
from sim_plant.modes.radiation import Radiation, smallest_damping

FORMAT = "wec-rig radiation, version 1"
SUFFIX = ".radiation.json"
NOT_PASSIVE = -1.0e-6  # smallest eigenvalue of Re K_r by the largest: rounding gives -1e-12
_GRID = np.geomspace(1.0e-3, 1.0e4, 400)  # rad/s


def fingerprint(bem: BemModes) -> str:
    """Return a hash of the coefficients that a fit depends on."""
    digest = hashlib.sha256(json.dumps(bem.modes).encode())
    for values in (bem.frequency, bem.added_mass, bem.damping, bem.added_mass_infinite):
        digest.update(np.ascontiguousarray(values, "<f8").tobytes())
    return digest.hexdigest()


def to_text(bem: BemModes, memory: Radiation) -> str:
    """Return the text of a file; numbers keep every bit."""
    arrays = {
        name: value.tolist() if isinstance(value, np.ndarray) else list(value)
        for name, value in memory._asdict().items()
    }
    head = {"format": FORMAT, "modes": list(bem.modes), "fitted_to": fingerprint(bem)}
    lines = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in (head | arrays).items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"


def read(path: Path, bem: BemModes) -> Radiation:
    """Return the radiation of a file.

    Raises ValueError if it is no such file, belongs to other coefficients than those given, or is
    not stable and passive; OSError if it cannot be read.
    """
    with open_regular_file(path) as stream:
        text = stream.read()
    try:
        given = json.loads(text)
        known = isinstance(given, dict) and given.get("format") == FORMAT
    except ValueError:
        known = False
    if not known:
        raise ValueError(f"{path}: is no file of a fitted radiation ({FORMAT!r})")
    if given.get("fitted_to") != fingerprint(bem):
        raise ValueError(
            f"{path}: is stale: it was fitted to other coefficients of {given.get('modes')} than "
            f"the BEM file now has of {list(bem.modes)}; write it again with rig plant from-bem, "
            "or remove the key"
        )
    memory = _radiation(path, given, len(bem.modes))
    if np.any(memory.diagonal >= 0.0) or smallest_damping(memory, _GRID) < NOT_PASSIVE:
        raise ValueError(f"{path}: the radiation is not stable and passive; write it again")
    return memory


def _radiation(path: Path, given: dict[str, Any], modes: int) -> Radiation:
    states = len(given.get("source") or ())
    shapes: dict[str, tuple[int, ...]] = {
        "diagonal": (states,), "cross": (states,), "input": (states,), "output": (modes, states),
        "error": (modes, modes), "left_out": (-1,), "added_mass": (modes, modes),
    }  # fmt: skip
    try:
        indices = [tuple(int(k) for k in given[name]) for name in ("source", "partner")]
        arrays = {name: np.array(given[name], np.float64) for name in shapes}
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: is damaged: {error}") from error
    for name, shape in shapes.items():
        if arrays[name].shape != shape and shape != (-1,):
            raise ValueError(f"{path}: {name} has the shape {arrays[name].shape}, expected {shape}")
    for name, values, end in zip(("source", "partner"), indices, (modes, states), strict=True):
        if len(values) != states or not all(0 <= k < end for k in values):
            raise ValueError(f"{path}: {name} must be {states} numbers from 0 to {end - 1}")
    return Radiation(indices[0], indices[1], **arrays)
