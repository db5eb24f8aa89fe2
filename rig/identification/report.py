"""Output of an identification: `identification.json`, `identification.nc` and text tables.

JSON stores complex numbers as lists of real and imaginary parts; NaN is null. NetCDF stores them as
variables `..._re` and `..._im`, one set per model, with units in the attributes.
"""

import json
import math
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rig.emulation.bem_impedance import BemImpedance
from rig.identification import bem as bem_file
from rig.identification.axis_units import LINEAR, AxisUnits
from rig.identification.excitation import Excitation
from rig.identification.families import Member
from rig.identification.fit import FittedImpedance, zero_crossing
from rig.identification.frf import Response
from rig.identification.identify import Identification
from rig.identification.impedances import Model, ratio
from rig.presentation.json_values import json_value
from rig.presentation.phrases import aligned
from rig.spectra.periods import Floats

JSON, NETCDF = "identification.json", "identification.nc"
CONVENTION = "e^{+i omega t}, t on the wave clock; force on the body; bands: 95 % radius"
NOT_CONSTANTS = (
    "M, B and K are parameters of a fit, not physical constants: radiation makes mass and damping "
    "vary with frequency. ±: 95 % by its misfit; another order gives others"
)


def unit(name: str, units: AxisUnits = LINEAR) -> str:
    """Return the unit of a response from its name."""
    return units.admittance if name.startswith("Y") else units.impedance


def as_dict(identification: Identification) -> dict[str, Any]:
    """Return the identification as JSON values."""
    content: dict[str, Any] = json_value(
        {
            "runs": identification.runs,
            **{key: identification.attributes.get(key, "") for key in ("mode", "campaign")},
            "convention": CONVENTION,
            "models": [
                _model_as_dict(model, fits, identification.bem_impedances.get(model.axis))
                for model, fits in zip(identification.models, identification.fits, strict=True)
            ],
            "family": identification.family,
            "excitation": [
                _excitation_as_dict(excitation, identification.bem)
                for excitation in identification.excitations
            ],
            "notes": identification.notes,
        }
    )
    return content


def _model_as_dict(
    model: Model, fits: dict[str, tuple[FittedImpedance, ...]], bem: BemImpedance | None
) -> dict[str, Any]:
    quotient, units = ratio(model), model.units
    return {
        "name": model.name,
        "axis": model.axis,
        f"spring_{units.stiffness_key}": model.spring_rate,
        f"peak_{units.force_key}": model.peak,
        "peak_a": model.peak_a,
        "realisations": model.realisations,
        "periods": model.periods,
        "rows": model.row_labels,
        "frequency_hz": model.frequency.tolist(),
        "responses": {
            name: {"unit": unit(name, units)}
            | {part: values.tolist() for part, values in _response_parts(response).items()}
            for name, response in model.responses.items()
        },
        "published_ratio": None
        if quotient is None
        else {"re": quotient.real.tolist(), "im": quotient.imag.tolist()},
        "zero_crossing_hz": {
            name: zero_crossing(model.frequency, model.responses[name].value) for name in fits
        },
        "fits": {
            name: [_fit_as_dict(fitted, units) for fitted in fits_of_response]
            for name, fits_of_response in fits.items()
        },
        **({} if bem is None else {"bem": _bem_as_dict(model, bem)}),
    }


def bem_response(model: Model) -> str:
    """Return the name of the response that a BEM file is compared with."""
    return "Z_i" if "Z_i" in model.responses else "Z_id"


def _bem_as_dict(model: Model, bem: BemImpedance) -> dict[str, Any]:
    expected, name = bem.at(model.frequency), bem_response(model)
    difference = model.responses[name].value - expected
    share = np.abs(difference / expected)[np.isfinite(expected)]
    return {
        "file": bem.name,
        "mode": bem.mode,
        "response": name,
        "re": expected.real.tolist(),
        "im": expected.imag.tolist(),
        "median": float(np.median(share)) if share.size else None,
        "worst": float(share.max()) if share.size else None,
        "median_re_difference": float(np.nanmedian(difference.real)) if share.size else None,
    }


def _response_parts(response: Response) -> dict[str, Floats]:
    return {
        "re": response.value.real,
        "im": response.value.imag,
        "noise_band": response.noise,
        "total_band": response.total,
        "systematic_band": response.systematic,
        "rounding_band": response.rounding,
    }


def _fit_as_dict(fitted: FittedImpedance, units: AxisUnits) -> dict[str, Any]:
    keys = (
        f"mass_{units.mass_key}",
        f"damping_{units.damping_key}",
        f"stiffness_{units.stiffness_key}",
    )
    values = (fitted.mass, fitted.damping, fitted.stiffness)
    return {
        "order": fitted.order,
        **dict(zip(keys, values, strict=True)),
        "intervals_95": dict(zip(keys, fitted.intervals, strict=True)),
        "natural_frequency_hz": fitted.natural_frequency,
        "sections": fitted.sections,
        "fit_percent": fitted.fit_percent,
        "worst": fitted.worst,
    }


def _excitation_as_dict(excitation: Excitation, bem: bem_file.Bem | None) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "axis": excitation.axis,
        "spring_n_per_m": excitation.spring_rate,
        "eta": excitation.probe,
        "seas": excitation.seas,
        "experiments": excitation.experiments,
        "rows": excitation.row_labels,
        "frequency_hz": excitation.frequency.tolist(),
        "unit": "N/m",
        "re": excitation.value.real.tolist(),
        "im": excitation.value.imag.tolist(),
        "band": excitation.band.tolist(),
        "s_eta_m2": excitation.power.tolist(),
        "good": excitation.good.tolist(),
        "drag_taken_out_n_s2_per_m2": excitation.drag,
    }
    if bem is not None:
        expected = bem_file.excitation_at(bem, excitation.frequency)
        errors = _errors_against(bem, excitation)
        entry |= {
            "bem": bem.name,
            "bem_re": expected.real.tolist(),
            "bem_im": expected.imag.tolist(),
            "worst_against_bem": float(np.max(errors)) if errors.size else None,
            "median_against_bem": float(np.median(errors)) if errors.size else None,
        }
    return entry


def _errors_against(bem: bem_file.Bem, excitation: Excitation) -> Floats:
    """Return the relative differences |f - f_BEM|/|f_BEM| on the good lines."""
    expected = bem_file.excitation_at(bem, excitation.frequency)
    errors = np.abs(excitation.value - expected) / np.abs(expected)
    return np.asarray(errors[excitation.good], dtype=np.float64)


def dataset(identification: Identification) -> xarray.Dataset:
    """Return all responses and excitations by line; models are numbered in order."""
    variables: dict[str, Any] = {}
    for i, model in enumerate(identification.models):
        line = f"line_{i}"
        variables[f"frequency_{i}"] = (line, model.frequency, {"units": "Hz", "model": model.name})
        for name, response in model.responses.items():
            line_attributes = {"units": unit(name, model.units), "model": model.name}
            for part, values in _response_parts(response).items():
                variables[f"{name}_{i}_{part}"] = (line, values, line_attributes)
    for i, excitation in enumerate(identification.excitations):
        line = f"wave_line_{i}"
        variables[f"wave_frequency_{i}"] = (line, excitation.frequency, {"units": "Hz"})
        for part, values in (
            ("re", excitation.value.real),
            ("im", excitation.value.imag),
            ("band", excitation.band),
        ):
            units = {"units": "N/m", "eta": excitation.probe}
            variables[f"excitation_{i}_{part}"] = (line, values, units)
        variables[f"s_eta_{i}"] = (line, excitation.power, {"units": "m2"})
        good = excitation.good.astype(np.int64)
        variables[f"good_{i}"] = (line, good, {"long_name": "1: line is usable"})
    attributes = {"runs": " ".join(identification.runs), "convention": CONVENTION}
    names = [model.name for model in identification.models]
    return xarray.Dataset(variables, attrs={**attributes, "models": names})


def write_json(content: dict[str, Any], path: Path) -> Path:
    """Write JSON values into a file; return its path."""
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    path.write_text(text, encoding="utf-8")
    return path


def write(identification: Identification, folder: Path) -> list[Path]:
    """Write both files into a folder; return their paths."""
    netcdf_path = folder / NETCDF
    dataset(identification).to_netcdf(netcdf_path, engine="h5netcdf")
    return [write_json(as_dict(identification), folder / JSON), netcdf_path]


def as_text(identification: Identification) -> str:
    """Return a text report: models, dependence on amplitude, excitation, notes."""
    models, family = model_table(identification), family_table(identification)
    lines = ["Models of the impedance", *aligned(models), *textwrap.wrap(NOT_CONSTANTS, 98)]
    lines += bem_lines(identification)
    lines += ["", "With amplitude", *aligned(family)]
    for excitation in identification.excitations:
        lines += ["", *_excitation_text(excitation, identification.bem)]
    lines += ["", *(f"!! {note}" for note in identification.notes)] if identification.notes else []
    return "\n".join(lines)


def model_table(identification: Identification) -> list[tuple[str, ...]]:
    """Return heads and rows of the models, with rates of springs where drivetrains have them."""
    rows = [_model_heads(identification.models[0].units), *_model_cells(identification)]
    return rows if _any_spring(identification) else _without(rows, {1})


def family_table(identification: Identification) -> list[tuple[str, ...]]:
    """Return heads and rows by amplitude; columns of a drivetrain only where there is one."""
    rows = [_family_heads(identification.models[0].units), *_family_cells(identification.family)]
    left_out = set() if _any_spring(identification) else {1}
    left_out |= set() if any(model.has_drivetrain for model in identification.models) else {3, 4}
    return _without(rows, left_out)


def _any_spring(identification: Identification) -> bool:
    return any(model.sprung for model in identification.models)


def _without(rows: list[tuple[str, ...]], columns: set[int]) -> list[tuple[str, ...]]:
    return [tuple(cell for i, cell in enumerate(row) if i not in columns) for row in rows]


def _model_heads(units: AxisUnits) -> tuple[str, ...]:
    return (
        "axis", f"spring {units.stiffness}", "peak A", "", "order", f"M {units.mass}",
        f"B {units.damping}", f"K {units.stiffness}", "f0 Hz", "fit %", "band %",
    )  # fmt: skip


def bem_lines(identification: Identification) -> list[str]:
    """Return a line of text for each model that a BEM file is compared with."""
    lines = []
    for model in identification.models:
        bem = identification.bem_impedances.get(model.axis)
        if bem is None:
            continue
        found = _bem_as_dict(model, bem)
        if found["median"] is None:
            lines.append(f"{model.name}: no line within the frequencies of {bem.name}")
            continue
        lines.append(
            f"{model.name}: {found['response']} against {bem.name} ({bem.mode}: mass, radiation, "
            f"hydrostatics): median {100 * found['median']:.2g} %, worst {100 * found['worst']:.2g}"
            f" % (complex); Re Z {found['median_re_difference']:+.3g} {model.units.damping} "
            "(median): viscous damping and friction, which the file lacks"
        )
    return lines


def with_interval(value: float, half_width: float) -> str:
    """Return a number with its interval as text; an interval that is not known is `?`."""

    def shown(number: float) -> str:
        return f"{number:.0f}" if abs(number) >= 1000.0 else f"{number:.3g}"

    known = math.isfinite(half_width)
    return f"{shown(value)}±{shown(float(f'{half_width:.2g}')) if known else '?'}"


def _model_cells(identification: Identification) -> list[tuple[str, ...]]:
    """Return a row of the table of models for each fit."""
    rows: list[tuple[str, ...]] = []
    for model, fits in zip(identification.models, identification.fits, strict=True):
        for name, fits_of_response in fits.items():
            response = model.responses[name]
            bands = response.band / np.abs(response.value)
            band = f"{100.0 * np.nanmedian(bands):.2g}" if np.isfinite(bands).any() else "?"
            for fitted in fits_of_response:
                rows.append((
                    model.axis, f"{model.spring_rate:g}", f"{model.peak_a:.3g}", name,
                    str(fitted.order),
                    *map(with_interval, fitted[:3], fitted.intervals),
                    f"{fitted.natural_frequency:.4f}", f"{fitted.fit_percent:.1f}", band,
                ))  # fmt: skip
    return rows


def _family_heads(units: AxisUnits) -> tuple[str, ...]:
    return (
        "axis", f"spring {units.stiffness}", "peak A", f"Re Z_d {units.damping}",
        f"K_d {units.stiffness}", "noise %", "distortion %", "even lines %", "odd lines %",
    )  # fmt: skip


def _family_cells(members: tuple[Member, ...]) -> list[tuple[str, ...]]:
    """Return a row of the table of amplitudes for each member; unknown values are a dash."""

    def known(value: float, form: str) -> str:
        return format(value, form) if math.isfinite(value) else "-"

    return [
        (
            member.axis,
            f"{member.spring_rate:g}",
            f"{member.peak_a:.3g}",
            known(member.drivetrain_damping, ".0f"),
            known(member.drivetrain_stiffness, ".0f"),
            *(
                known(100.0 * share, ".2g")
                for share in (member.noise, member.distortion, member.even, member.odd)
            ),
        )
        for member in members
    ]


def _excitation_text(excitation: Excitation, bem: bem_file.Bem | None) -> list[str]:
    good = excitation.good
    lines = [
        f"Excitation at {excitation.spring_rate:g} N/m: {excitation.experiments} experiments in "
        f"{excitation.seas} seas, eta from {excitation.probe}; "
        f"{int(good.sum())} of {good.size} lines good",
        f"quadratic drag of {excitation.drag:.4g} N·s²/m² subtracted line by line"
        if excitation.drag
        else "no significant quadratic drag in calm water: Z_i includes any drag",
    ]
    if bem is not None and good.any():
        percent = 100.0 * _errors_against(bem, excitation)
        lines.append(
            f"against {bem.name}: median {np.median(percent):.2g} %, "
            f"worst {percent.max():.2g} % (complex difference, e^(+iωt))"
        )
    return lines
