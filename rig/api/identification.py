"""`rig.identify`: impedances and wave excitation from runs with an open-loop reference."""

import os
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.api.errors import public_errors
from rig.api.run import Run
from rig.api.run_lookup import find_run

if TYPE_CHECKING:
    import pandas
    import xarray

    from rig.identification.identify import Identification as Identified

PathLike = str | os.PathLike[str]


_INTERVALS = ("mass_interval", "damping_interval", "stiffness_interval")


class Identification:
    """Impedances of a device, identified from runs, as `rig identify` gives them.

    Its text (`print`) is the report of the command.
    """

    def __init__(self, result: "Identified") -> None:
        self._result = result

    def __repr__(self) -> str:
        from rig.identification.report import as_text

        return as_text(self._result)

    @cached_property
    def fits(self) -> "pandas.DataFrame":
        """The parametric models: mass (kg), damping (N*s/m), stiffness (N/m), frequency (Hz).

        Of an axis that rotates kg*m2, N*m*s/rad and N*m/rad. They are parameters of a fit, not
        physical constants; `..._interval` is the half-width of the 95 % interval by its misfit.
        """
        import pandas

        lines = [
            {
                "axis": model.axis,
                "spring_rate": model.spring_rate,
                "peak_current": model.peak_a,
                "response": name,
                "order": fitted.order,
                "mass": fitted.mass,
                "damping": fitted.damping,
                "stiffness": fitted.stiffness,
                "natural_frequency": fitted.natural_frequency,
                **dict(zip(_INTERVALS, fitted.intervals, strict=True)),
            }
            for model, fits in zip(self._result.models, self._result.fits, strict=True)
            for name, fitted_orders in fits.items()
            for fitted in fitted_orders
        ]
        frame = pandas.DataFrame(lines)
        units = self._result.models[0].units
        parameters = (units.mass, units.impedance, units.stiffness)
        frame.attrs["units"] = {
            "spring_rate": units.stiffness,
            "peak_current": "A",
            **dict(zip(("mass", "damping", "stiffness"), parameters, strict=True)),
            "natural_frequency": "Hz",
            **dict(zip(_INTERVALS, parameters, strict=True)),
        }
        return frame

    @cached_property
    def responses(self) -> "dict[str, xarray.Dataset]":
        """Frequency responses of each model by its name, complex, over `frequency` (Hz).

        `Z_i` is the intrinsic impedance, force on the body over velocity (N*s/m); `Z_id` that of
        hull and drivetrain. `Z_i_band` is the radius of its 95 % circle.
        """
        import xarray

        from rig.identification.report import unit

        found = {}
        for model in self._result.models:
            variables: dict[str, tuple[str, Any, dict[str, str]]] = {}
            for name, response in model.responses.items():
                attributes = {"units": unit(name, model.units)}
                variables[name] = ("frequency", response.value, attributes)
                variables[f"{name}_band"] = ("frequency", response.band, attributes)
            coordinate = ("frequency", model.frequency, {"units": "Hz"})
            found[model.name] = xarray.Dataset(variables, {"frequency": coordinate})
        return found

    @property
    def notes(self) -> tuple[str, ...]:
        """Excluded or doubtful data, with reasons."""
        return self._result.notes

    def write(self, folder: PathLike) -> list[Path]:
        """Write the results (JSON, NetCDF) and the pictures into a folder; return the files."""
        from rig.identification import report
        from rig.identification.pictures import write_page, write_pictures

        path = Path(folder)
        with public_errors():
            path.mkdir(parents=True, exist_ok=True)
            return [
                *report.write(self._result, path),
                *write_pictures(self._result, path),
                *write_page(self._result, path),
            ]


def identify(
    run: Run | PathLike | Iterable[Run | PathLike],
    *,
    order: int = 2,
    probe: str = "",
    runs: PathLike = "runs",
) -> Identification:
    """Identify impedances and wave excitation, as `rig identify` does; it writes nothing.

    Args:
        run: One run or several: those with an open-loop reference in calm water or waves, and wave
            calibrations.
        order: Order of the parametric models: 2, or also 4, 6 or 8.
        probe: Probe of the wave calibration at the position of the device.
        runs: Folder that holds the runs that are given by name.

    Raises:
        RigError: If the runs give no model, or the order is not allowed.
    """
    from rig.identification.identify import IdentificationOptions
    from rig.identification.identify import identify as identify_runs

    given = [run] if isinstance(run, Run | str | os.PathLike) else list(run)
    with public_errors():
        paths = [
            each.path if isinstance(each, Run) else find_run(Path(each), Path(runs))
            for each in given
        ]
        return Identification(identify_runs(paths, IdentificationOptions(order, probe)))
