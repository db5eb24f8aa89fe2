"""Output of an identification: `identification.json`, `identification.nc` and text tables.

JSON stores complex numbers as lists of real and imaginary parts; NaN is null. NetCDF stores them as
variables `..._re` and `..._im`, one set per model, with units in the attributes.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rig.identification import bem as bem_file
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
IMPEDANCE, ADMITTANCE = "N*s/m", "m/s/N"


def unit(name: str) -> str:
    """Return the unit of a response from its name."""
    return ADMITTANCE if name.startswith("Y") else IMPEDANCE


def as_dict(identification: Identification) -> dict[str, Any]:
    """Return the identification as JSON values."""
    content: dict[str, Any] = json_value(
        {
            "runs": identification.runs,
            **{key: identification.attributes.get(key, "") for key in ("mode", "campaign")},
            "convention": CONVENTION,
            "models": [
                _model_as_dict(model, fits)
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


def _model_as_dict(model: Model, fits: dict[str, tuple[FittedImpedance, ...]]) -> dict[str, Any]:
    quotient = ratio(model)
    return {
        "name": model.name,
        "axis": model.axis,
        "spring_n_per_m": model.spring_rate,
        "peak_n": model.peak,
        "peak_a": model.peak_a,
        "realisations": model.realisations,
        "periods": model.periods,
        "rows": model.row_labels,
        "frequency_hz": model.frequency.tolist(),
        "responses": {
            name: {"unit": unit(name)}
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
            name: [_fit_as_dict(fitted) for fitted in fits_of_response]
            for name, fits_of_response in fits.items()
        },
    }


def _response_parts(response: Response) -> dict[str, Floats]:
    return {
        "re": response.value.real,
        "im": response.value.imag,
        "noise_band": response.noise,
        "total_band": response.total,
    }


def _fit_as_dict(fitted: FittedImpedance) -> dict[str, Any]:
    return {
        "order": fitted.order,
        "mass_kg": fitted.mass,
        "damping_n_s_per_m": fitted.damping,
        "stiffness_n_per_m": fitted.stiffness,
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
            line_attributes = {"units": unit(name), "model": model.name}
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
    models = [MODEL_HEADS, *model_cells(identification)]
    family = [FAMILY_HEADS, *family_cells(identification.family)]
    lines = ["Models of the impedance", *aligned(models)]
    lines += ["", "With amplitude", *aligned(family)]
    for excitation in identification.excitations:
        lines += ["", *_excitation_text(excitation, identification.bem)]
    lines += ["", *(f"!! {note}" for note in identification.notes)] if identification.notes else []
    return "\n".join(lines)


MODEL_HEADS = (
    "axis", "spring N/m", "peak A", "", "order", "M kg", "B N·s/m", "K N/m", "f0 Hz", "fit %",
    "band %",
)  # fmt: skip


def model_cells(identification: Identification) -> list[tuple[str, ...]]:
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
                    str(fitted.order), f"{fitted.mass:.0f}", f"{fitted.damping:.0f}",
                    f"{fitted.stiffness:.0f}", f"{fitted.natural_frequency:.4f}",
                    f"{fitted.fit_percent:.1f}", band,
                ))  # fmt: skip
    return rows


FAMILY_HEADS = (
    "axis", "spring N/m", "peak A", "Re Z_d N·s/m", "K_d N/m", "noise %", "distortion %",
    "even lines %", "odd lines %",
)  # fmt: skip


def family_cells(members: tuple[Member, ...]) -> list[tuple[str, ...]]:
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
