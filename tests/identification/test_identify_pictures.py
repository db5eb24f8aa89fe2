"""Pictures and tables of an identification: legend, fits, and what a rig lacks."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.legend import Legend

from rig.identification import pictures, report
from rig.identification.families import Member
from rig.identification.fit import FittedImpedance
from rig.identification.frf import Response
from rig.identification.identify import Identification
from rig.identification.impedances import Model
from rig.presentation import picture

FREQUENCY = np.linspace(0.1, 1.0, 37)
OMEGA = 2.0 * np.pi * FREQUENCY
MASS, DAMPING, STIFFNESS = 4700.0, 1100.0, 30000.0
BODY = DAMPING + 1j * (OMEGA * MASS - STIFFNESS / OMEGA)
FIT = FittedImpedance(MASS, DAMPING, STIFFNESS, (), 97.0, 0.1)
STYLES = {
    "screen": picture.DrawStyle(),
    "paper": picture.DrawStyle(paper=True),
    "paper-single": picture.DrawStyle(paper=True, columns=1),
}


def response(value: np.ndarray, share: float) -> Response:
    radius, none = share * np.abs(value), np.zeros(value.shape)
    return Response(value.astype(complex), radius, radius, radius, radius, none, none)


def model(drivetrain: complex, *, sprung: bool) -> Model:
    """A body behind a drivetrain of a constant impedance, which is known within 1 N s/m."""
    series = np.full(BODY.shape, drivetrain)
    responses = {
        "Z_i": response(BODY, 1e-3), "Z_id": response(BODY + series, 1e-3),
        "Z_d": response(series, 1.0 / abs(drivetrain)), "Y_i": response(1.0 / BODY, 1e-3),
        "Y_id_command": response(1.0 / (BODY + series), 1e-3),
        "Y_id_current": response(1.0 / (BODY + series), 1e-3),
    }  # fmt: skip
    labels = {"body": "load cell", "command": "command", "current": "current"}
    return Model(
        "heave", 0.0, (), 770.0, 5.0, 2, 4, (), FREQUENCY, responses, labels, sprung=sprung
    )


def identification(*models: Model) -> Identification:
    fits = tuple({"Z_i": (FIT,), "Z_id": (FIT,)} for _ in models)
    members = tuple(Member("heave", 0.0, m.peak_a, 7.0, 8.0, *[0.01] * 5) for m in models)
    attributes = {"run": "a_run", "mode": "rehearsal", "campaign": "test"}
    return Identification(attributes, ("a_run",), models, fits, members, (), None, ())


@pytest.mark.parametrize("style", STYLES)
def test_the_legend_covers_nothing(
    style: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Neither curves nor labels, within the picture; bands are named with their width."""
    drawn = []

    def keep(figure: picture.Figure, path: Path, *args: object) -> Path:
        drawn.append(figure)
        picture_save(figure, path)
        return path

    picture_save = picture.save
    monkeypatch.setattr(picture, "save", keep)
    with picture.drawn_as(STYLES[style]):
        pictures.write_pictures(identification(model(0.5, sprung=False)), tmp_path)
    (figure,) = drawn
    renderer = FigureCanvasAgg(figure).get_renderer()
    (legend,) = figure.findobj(Legend)
    box = legend.get_window_extent(renderer)
    assert not any(box.overlaps(axes.get_tightbbox(renderer)) for axes in figure.axes)
    assert (box.x0, box.y0) >= (0.0, 0.0)
    assert box.x1 <= figure.bbox.x1
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[-1] == "bands: 95 %, median ±0.1 %"


def test_both_fits_remain_visible_where_they_agree() -> None:
    curves = pictures.admittances(model(0.5, sprung=False), {"Z_i": (FIT,), "Z_id": (FIT,)})
    fits = [curve for curve in curves if curve.label.startswith("fit")]
    assert [curve.style for curve in fits] == ["-", "--"]
    assert all(a.colour != b.colour for a, b in pairwise(fits))


@pytest.mark.parametrize(
    ("drivetrain", "expected"), [(0.5, False), (0.9j, False), (1.1, True), (-40.0, True)]
)
def test_a_drivetrain_differs_from_0_by_more_than_its_band(
    drivetrain: complex, expected: bool, tmp_path: Path
) -> None:
    found = identification(model(drivetrain, sprung=False))
    assert found.models[0].has_drivetrain is expected
    names = {path.stem for path in pictures.write_pictures(found, tmp_path)}
    assert names == {"admittance_heave", *(("intrinsic", "drivetrain") if expected else ())}
    assert ("Re Z_d" in report.as_text(found)) is expected


def test_a_rate_is_shown_only_of_a_spring() -> None:
    bare, sprung = model(0.5, sprung=False), model(0.5, sprung=True)
    assert (bare.name, sprung.name) == ("heave 5 A", "heave 0 N/m 5 A")
    assert "spring" not in report.as_text(identification(bare))
    assert "spring N/m" in report.as_text(identification(sprung))
    lengths = {len(row) for row in report.model_table(identification(bare))}
    assert lengths == {10}
