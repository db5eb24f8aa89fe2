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

JSON, NETCDF = "identification.json", "identification.nc"
CONVENTION = "e^{+i omega t}, t on the wave clock; force on the body; bands: 95 % radius"
IMPEDANCE, ADMITTANCE = "N*s/m", "m/s/N"


def unit(name: str) -> str:
    """Return the unit of a response from its name."""
    return ADMITTANCE if name.startswith("Y") else IMPEDANCE


def as_dict(identification: Identification) -> dict[str, Any]:
    """Return the identification as JSON values."""
    content: dict[str, Any] = _json_value(
        {
            "runs": list(identification.runs),
            **{key: identification.attributes.get(key, "") for key in ("mode", "campaign")},
            "convention": CONVENTION,
            "models": [
                _model_as_dict(model, fits)
                for model, fits in zip(identification.models, identification.fits, strict=True)
            ],
            "family": [member._asdict() for member in identification.family],
            "excitation": [
                _excitation_as_dict(excitation, identification.bem)
                for excitation in identification.excitations
            ],
            "notes": list(identification.notes),
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
        "rows": list(model.row_labels),
        "frequency_hz": model.frequency.tolist(),
        "responses": {
            name: _response_as_dict(name, response) for name, response in model.responses.items()
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


def _response_as_dict(name: str, response: Response) -> dict[str, Any]:
    return {
        "unit": unit(name),
        "re": response.value.real.tolist(),
        "im": response.value.imag.tolist(),
        "noise_band": response.noise.tolist(),
        "total_band": response.total.tolist(),
    }


def _fit_as_dict(fitted: FittedImpedance) -> dict[str, Any]:
    return {
        "order": fitted.order,
        "mass_kg": fitted.mass,
        "damping_n_s_per_m": fitted.damping,
        "stiffness_n_per_m": fitted.stiffness,
        "natural_frequency_hz": fitted.natural_frequency,
        "sections": [section._asdict() for section in fitted.sections],
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
        "rows": list(excitation.row_labels),
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
        relative_error = np.abs(excitation.value - expected) / np.abs(expected)
        entry |= {
            "bem": bem.name,
            "bem_re": expected.real.tolist(),
            "bem_im": expected.imag.tolist(),
            "worst_against_bem": float(np.max(relative_error[excitation.good]))
            if excitation.good.any()
            else None,
            "median_against_bem": float(np.median(relative_error[excitation.good]))
            if excitation.good.any()
            else None,
        }
    return entry


def _json_value(value: Any) -> Any:
    """Return the value with None for NaN and infinity, which JSON lacks."""
    if isinstance(value, dict):
        return {key: _json_value(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_json_value(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def dataset(identification: Identification) -> xarray.Dataset:
    """Return all responses and excitations by line; models are numbered in order."""
    variables: dict[str, Any] = {}
    for i, model in enumerate(identification.models):
        line = f"line_{i}"
        variables[f"frequency_{i}"] = (line, model.frequency, {"units": "Hz", "model": model.name})
        for name, response in model.responses.items():
            line_attributes = {"units": unit(name), "model": model.name}
            for part, values in (
                ("re", response.value.real),
                ("im", response.value.imag),
                ("noise_band", response.noise),
                ("total_band", response.total),
            ):
                variables[f"{name}_{i}_{part}"] = (line, values, line_attributes)
    for i, excitation in enumerate(identification.excitations):
        line = f"wave_line_{i}"
        variables[f"wave_frequency_{i}"] = (line, excitation.frequency, {"units": "Hz"})
        for part, values in (
            ("re", excitation.value.real),
            ("im", excitation.value.imag),
            ("band", excitation.band),
        ):
            variables[f"excitation_{i}_{part}"] = (
                line,
                values,
                {"units": "N/m", "eta": excitation.probe},
            )
        variables[f"s_eta_{i}"] = (line, excitation.power, {"units": "m2"})
        variables[f"good_{i}"] = (
            line,
            excitation.good.astype(np.int64),
            {"long_name": "1: line is usable"},
        )
    attributes = {"runs": " ".join(identification.runs), "convention": CONVENTION}
    return xarray.Dataset(
        variables, attrs={**attributes, "models": [model.name for model in identification.models]}
    )


def write(identification: Identification, folder: Path) -> list[Path]:
    """Write both files into a folder; return their paths."""
    json_path, netcdf_path = folder / JSON, folder / NETCDF
    json_path.write_text(
        json.dumps(as_dict(identification), indent=1, allow_nan=False) + "\n", encoding="utf-8"
    )
    dataset(identification).to_netcdf(netcdf_path, engine="h5netcdf")
    return [json_path, netcdf_path]


def as_text(identification: Identification) -> str:
    """Return a text report: models, dependence on amplitude, excitation, notes."""
    lines = [*_models_text(identification), "", *_family_text(identification.family)]
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
            band = np.nanmedian(_known_band(response.band) / np.abs(response.value))
            for fitted in fits_of_response:
                rows.append((
                    model.axis, f"{model.spring_rate:g}", f"{model.peak_a:.3g}", name,
                    str(fitted.order), f"{fitted.mass:.0f}", f"{fitted.damping:.0f}",
                    f"{fitted.stiffness:.0f}", f"{fitted.natural_frequency:.4f}",
                    f"{fitted.fit_percent:.1f}", "?" if band < 0 else f"{100.0 * band:.2g}",
                ))  # fmt: skip
    return rows


FAMILY_HEADS = (
    "axis", "spring N/m", "peak A", "Re Z_d N·s/m", "K_d N/m", "noise %", "distortion %",
    "even lines %", "odd lines %",
)  # fmt: skip


def family_cells(members: tuple[Member, ...]) -> list[tuple[str, ...]]:
    """Return a row of the table of amplitudes for each member; unknown values are a dash."""

    def percent(value: float) -> str:
        return f"{100.0 * value:.2g}" if math.isfinite(value) else "-"

    def rounded(value: float) -> str:
        return f"{value:.0f}" if math.isfinite(value) else "-"

    rows: list[tuple[str, ...]] = []
    for member in members:
        damping, stiffness = (
            rounded(member.drivetrain_damping),
            rounded(member.drivetrain_stiffness),
        )
        sizes = (
            percent(member.noise),
            percent(member.distortion),
            percent(member.even),
            percent(member.odd),
        )
        rows.append(
            (
                member.axis,
                f"{member.spring_rate:g}",
                f"{member.peak_a:.3g}",
                damping,
                stiffness,
                *sizes,
            )
        )
    return rows


def _known_band(band: Any) -> Any:
    return band if np.isfinite(band).any() else np.full(band.shape, -1e9)


def _models_text(identification: Identification) -> list[str]:
    return ["Models of the impedance", *_align([MODEL_HEADS, *model_cells(identification)])]


def _family_text(members: tuple[Member, ...]) -> list[str]:
    return ["With amplitude", *_align([FAMILY_HEADS, *family_cells(members)])]


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
        expected = bem_file.excitation_at(bem, excitation.frequency)
        percent_error = 100.0 * np.abs(excitation.value - expected)[good] / np.abs(expected)[good]
        lines.append(
            f"against {bem.name}: median {np.median(percent_error):.2g} %, "
            f"worst {percent_error.max():.2g} % (complex difference, e^(+iωt))"
        )
    return lines


def _align(rows: list[tuple[str, ...]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  " + "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        for row in rows
    ]
