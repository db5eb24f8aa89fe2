"""The BEM files that a plant file names: coefficients of the hull in heave and in surge."""

from pathlib import Path
from typing import Any

from rig.config.yaml_source import SourceMap


def bem_paths(plant: dict[str, Any], locate: SourceMap) -> tuple[Path, Path]:
    """Return the paths of a plant's BEM files, of heave and of surge."""
    return (
        locate.resolve_path(("bem",), plant["bem"]),
        locate.resolve_path(("surge", "bem"), plant["surge"]["bem"]),
    )


def bem_settings(plant: dict[str, Any], locate: SourceMap) -> dict[str, str]:
    """Return the paths of a plant's BEM files as `rehearsal.devices.build_world` reads them."""
    heave, surge = bem_paths(plant, locate)
    return {"bem": str(heave), "surge_bem": str(surge)}
