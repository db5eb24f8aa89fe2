"""An identification written down: `identification.json`, `identification.nc`, and a table.

JSON has the complex numbers as lists of real and imaginary parts; NaN is null. NetCDF has them as
variables `..._re` and `..._im`, one set a model, units in the attributes.
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
from rig.identification.fit import Fitted, zero_crossing
from rig.identification.frf import Response
from rig.identification.identify import Identification
from rig.identification.impedances import Model, ratio

JSON, NETCDF = "identification.json", "identification.nc"
CONVENTION = "e^{+i omega t}, t on the wave clock; force on the body; bands: 95 % radius"
IMPEDANCE, ADMITTANCE = "N*s/m", "m/s/N"


def unit(name: str) -> str:
    """Of a response, by its name."""
    return ADMITTANCE if name.startswith("Y") else IMPEDANCE


def as_dict(found: Identification) -> dict[str, Any]:
    """All of it as JSON values."""
    whole: dict[str, Any] = _plain(
        {
            "runs": list(found.runs),
            **{key: found.attributes.get(key, "") for key in ("mode", "campaign")},
            "convention": CONVENTION,
            "models": [
                _of_model(model, fits) for model, fits in zip(found.models, found.fits, strict=True)
            ],
            "family": [member._asdict() for member in found.family],
            "excitation": [_of_excitation(one, found.bem) for one in found.excitations],
            "notes": list(found.notes),
        }
    )
    return whole


def _of_model(model: Model, fits: dict[str, tuple[Fitted, ...]]) -> dict[str, Any]:
    quotient = ratio(model)
    return {
        "name": model.name,
        "axis": model.axis,
        "spring_n_per_m": model.spring_rate,
        "peak_n": model.peak,
        "peak_a": model.peak_a,
        "realisations": model.realisations,
        "periods": model.periods,
        "rows": list(model.places),
        "frequency_hz": model.frequency.tolist(),
        "responses": {name: _of_response(name, r) for name, r in model.responses.items()},
        "published_ratio": None
        if quotient is None
        else {"re": quotient.real.tolist(), "im": quotient.imag.tolist()},
        "zero_crossing_hz": {
            name: zero_crossing(model.frequency, model.responses[name].value) for name in fits
        },
        "fits": {name: [_of_fit(one) for one in several] for name, several in fits.items()},
    }


def _of_response(name: str, response: Response) -> dict[str, Any]:
    return {
        "unit": unit(name),
        "re": response.value.real.tolist(),
        "im": response.value.imag.tolist(),
        "noise_band": response.noise.tolist(),
        "total_band": response.total.tolist(),
    }


def _of_fit(fitted: Fitted) -> dict[str, Any]:
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


def _of_excitation(one: Excitation, bem: bem_file.Bem | None) -> dict[str, Any]:
    told: dict[str, Any] = {
        "axis": one.axis,
        "spring_n_per_m": one.spring_rate,
        "eta": one.probe,
        "seas": one.seas,
        "experiments": one.experiments,
        "rows": list(one.places),
        "frequency_hz": one.frequency.tolist(),
        "unit": "N/m",
        "re": one.value.real.tolist(),
        "im": one.value.imag.tolist(),
        "band": one.band.tolist(),
        "s_eta_m2": one.power.tolist(),
        "good": one.good.tolist(),
        "drag_taken_out_n_s2_per_m2": one.drag,
    }
    if bem is not None:
        expected = bem_file.at(bem, one.frequency)
        off = np.abs(one.value - expected) / np.abs(expected)
        told |= {
            "bem": bem.name,
            "bem_re": expected.real.tolist(),
            "bem_im": expected.imag.tolist(),
            "worst_against_bem": float(np.max(off[one.good])) if one.good.any() else None,
            "median_against_bem": float(np.median(off[one.good])) if one.good.any() else None,
        }
    return told


def _plain(value: Any) -> Any:
    """The same without NaN and infinity, which JSON has not."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def dataset(found: Identification) -> xarray.Dataset:
    """All responses and excitations by line; models numbered in their order."""
    out: dict[str, Any] = {}
    for i, model in enumerate(found.models):
        line = f"line_{i}"
        out[f"frequency_{i}"] = (line, model.frequency, {"units": "Hz", "model": model.name})
        for name, response in model.responses.items():
            told = {"units": unit(name), "model": model.name}
            for part, values in (
                ("re", response.value.real),
                ("im", response.value.imag),
                ("noise_band", response.noise),
                ("total_band", response.total),
            ):
                out[f"{name}_{i}_{part}"] = (line, values, told)
    for i, one in enumerate(found.excitations):
        line = f"wave_line_{i}"
        out[f"wave_frequency_{i}"] = (line, one.frequency, {"units": "Hz"})
        for part, values in (("re", one.value.real), ("im", one.value.imag), ("band", one.band)):
            out[f"excitation_{i}_{part}"] = (line, values, {"units": "N/m", "eta": one.probe})
        out[f"s_eta_{i}"] = (line, one.power, {"units": "m2"})
        out[f"good_{i}"] = (line, one.good.astype(np.int64), {"long_name": "1: may be used"})
    attributes = {"runs": " ".join(found.runs), "convention": CONVENTION}
    return xarray.Dataset(out, attrs={**attributes, "models": [m.name for m in found.models]})


def write(found: Identification, folder: Path) -> list[Path]:
    """Both files into a folder."""
    told, table = folder / JSON, folder / NETCDF
    told.write_text(json.dumps(as_dict(found), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    dataset(found).to_netcdf(table, engine="h5netcdf")
    return [told, table]


def as_text(found: Identification) -> str:
    """For people: models, what changes with amplitude, excitation, what was left out."""
    lines = [*_models_text(found), "", *_family_text(found.family)]
    for one in found.excitations:
        lines += ["", *_excitation_text(one, found.bem)]
    lines += ["", *(f"!! {note}" for note in found.notes)] if found.notes else []
    return "\n".join(lines)


MODEL_HEADS = (
    "axis", "spring N/m", "peak A", "", "order", "M kg", "B N·s/m", "K N/m", "f0 Hz", "fit %",
    "band %",
)  # fmt: skip


def model_cells(found: Identification) -> list[tuple[str, ...]]:
    """A row of the table of models for each fit."""
    out: list[tuple[str, ...]] = []
    for model, fits in zip(found.models, found.fits, strict=True):
        for name, several in fits.items():
            response = model.responses[name]
            band = np.nanmedian(_known(response.band) / np.abs(response.value))
            for one in several:
                out.append((
                    model.axis, f"{model.spring_rate:g}", f"{model.peak_a:.3g}", name,
                    str(one.order), f"{one.mass:.0f}", f"{one.damping:.0f}",
                    f"{one.stiffness:.0f}", f"{one.natural_frequency:.4f}",
                    f"{one.fit_percent:.1f}", "?" if band < 0 else f"{100.0 * band:.2g}",
                ))  # fmt: skip
    return out


FAMILY_HEADS = (
    "axis", "spring N/m", "peak A", "Re Z_d N·s/m", "K_d N/m", "noise %", "distortion %",
    "even lines %", "odd lines %",
)  # fmt: skip


def family_cells(members: tuple[Member, ...]) -> list[tuple[str, ...]]:
    """A row of the table of amplitudes for each member; what is not known is a dash."""

    def percent(value: float) -> str:
        return f"{100.0 * value:.2g}" if math.isfinite(value) else "-"

    def whole(value: float) -> str:
        return f"{value:.0f}" if math.isfinite(value) else "-"

    out: list[tuple[str, ...]] = []
    for m in members:
        damping, stiffness = whole(m.drivetrain_damping), whole(m.drivetrain_stiffness)
        sizes = (percent(m.noise), percent(m.distortion), percent(m.even), percent(m.odd))
        out.append((m.axis, f"{m.spring_rate:g}", f"{m.peak_a:.3g}", damping, stiffness, *sizes))
    return out


def _known(band: Any) -> Any:
    return band if np.isfinite(band).any() else np.full(band.shape, -1e9)


def _models_text(found: Identification) -> list[str]:
    return ["Models of the impedance", *_aligned([MODEL_HEADS, *model_cells(found)])]


def _family_text(members: tuple[Member, ...]) -> list[str]:
    return ["With amplitude", *_aligned([FAMILY_HEADS, *family_cells(members)])]


def _excitation_text(one: Excitation, bem: bem_file.Bem | None) -> list[str]:
    good = one.good
    told = [
        f"Excitation at {one.spring_rate:g} N/m: {one.experiments} experiments in {one.seas} "
        f"seas, eta from {one.probe}; {int(good.sum())} of {good.size} lines good",
        f"quadratic drag of {one.drag:.4g} N·s²/m² taken out line by line"
        if one.drag
        else "no quadratic drag seen in calm water: what there is stands in Z_i",
    ]
    if bem is not None and good.any():
        expected = bem_file.at(bem, one.frequency)
        off = 100.0 * np.abs(one.value - expected)[good] / np.abs(expected)[good]
        told.append(
            f"against {bem.name}: median {np.median(off):.2g} %, worst {off.max():.2g} % "
            f"(complex difference, e^(+iωt))"
        )
    return told


def _aligned(rows: list[tuple[str, ...]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  " + "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        for row in rows
    ]
