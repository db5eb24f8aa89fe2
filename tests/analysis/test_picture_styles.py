"""Pictures in every style and format, read by other programs; surfaces between measured points."""

from __future__ import annotations

import re
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.tri import LinearTriInterpolator
from PIL import Image

from rig.analysis import panel
from rig.analysis.slices import interpolate, is_smooth, nearest_cells, triangulate
from rig.cli.options import FORMATS
from rig.presentation import picture
from rig.presentation.picture import DrawStyle, drawn_as

GRID = [(x, y) for x in np.linspace(-4000.0, 4000.0, 5) for y in np.linspace(-3500.0, -1000.0, 6)]
SVG = "{http://www.w3.org/2000/svg}"
ATTRIBUTES = {"run": "a_run", "campaign": "a_campaign", "mode": "rehearsal"}


def power(x: float, y: float) -> float:
    """Return a smooth surface, W, with its least value inside the grid."""
    return -80.0 + 4e-7 * (x - 700.0) ** 2 + 8e-6 * (y + 2100.0) ** 2 + 1e-9 * x * (y + 2100.0) ** 2


def draw(path: Path) -> Path:
    """Draw a framed surface with a heading and caption."""
    figure, body = picture.framed_figure(6.6, 4.0, "The title", ATTRIBUTES)
    axes = body.subplots()
    values = [power(*each) for each in GRID]
    panel.draw_surface(axes, GRID, values, panel.power_scale(values))
    panel.set_caption(axes, "best point")
    axes.set_xlabel("Ki, N/m", fontsize=7)
    return picture.save(figure, path)


def texts_of_svg(path: Path) -> list[str]:
    return ["".join(each.itertext()).strip() for each in ElementTree.parse(path).iter(f"{SVG}text")]


def test_a_smooth_surface_goes_through_its_points_and_is_nearer_than_triangles() -> None:
    values = [power(*each) for each in GRID]
    mesh, field = interpolate(GRID, values)
    at = {(round(x, 6), round(y, 6)): z for x, y, z in zip(mesh.x, mesh.y, field, strict=True)}
    for xy, value in zip(GRID, values, strict=True):
        assert at[round(xy[0], 6), round(xy[1], 6)] == pytest.approx(value, abs=1e-9)
    true = np.array([power(x, y) for x, y in zip(mesh.x, mesh.y, strict=True)])
    coarse = triangulate(GRID)
    linear = LinearTriInterpolator(coarse, values)(mesh.x, mesh.y)
    error, error_of_triangles = (np.sqrt(np.mean((z - true) ** 2)) for z in (field, linear))
    assert error < 0.35 * error_of_triangles


def test_a_surface_never_leaves_the_measured_region_or_the_range_of_powers() -> None:
    rng = np.random.default_rng(3)
    xy = [each for each in GRID if not (each[0] > 0 and each[1] > -2000)]  # half-finished
    values = rng.normal(size=len(xy)).tolist()
    mesh, field = interpolate(xy, values)
    assert min(values) <= field.min() <= field.max() <= max(values)
    used = np.unique(mesh.get_masked_triangles())
    # A point on a border belongs to no triangle by rounding: look a little inside.
    centres = [
        (float(mesh.x[t].mean()), float(mesh.y[t].mean())) for t in mesh.get_masked_triangles()
    ]
    finder = triangulate(xy).get_trifinder()
    assert all(finder(x, y) >= 0 for x, y in centres)
    assert len(used) > len(xy)
    _, _, cells = nearest_cells(xy, values)
    assert cells.mask.any()
    assert set(cells.compressed()) <= set(values)


def test_few_points_are_drawn_as_cells() -> None:
    corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)]
    assert not is_smooth(corners)
    assert is_smooth([*corners, (0.5, 0.5)])
    figure = Figure()
    axes = figure.subplots()
    panel.draw_surface(axes, corners, [1.0, 2.0, 3.0, 4.0], panel.power_scale([1.0, 4.0]))
    (mesh,) = axes.collections
    assert set(np.ma.masked_array(mesh.get_array()).compressed()) == {1.0, 2.0, 3.0, 4.0}


@pytest.mark.parametrize("style", [DrawStyle(), DrawStyle(True, 2), DrawStyle(True, 1)])
def test_each_format_is_readable_and_has_the_size_of_its_style(
    style: DrawStyle, tmp_path: Path
) -> None:
    width = {(False, 2): 6.6, (True, 2): 7.16, (True, 1): 3.5}[style.paper, style.columns]
    for name in picture.FORMATS:
        with drawn_as(style._replace(format=name)):
            path = draw(tmp_path / "surface.png")
        assert path == tmp_path / f"surface.{name}"
        if name == "png":
            with Image.open(path) as image:
                image.load()
                assert image.size[0] == pytest.approx(width * (300 if style.paper else 150), abs=2)
        elif name == "pdf":
            content = path.read_bytes()
            (box,) = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) [\d.]+ \]", content)
            assert float(box) == pytest.approx(72.0 * width, abs=1.0)
            assert b"/FontFile2" in content  # TrueType: text can be edited
            streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", content, re.DOTALL)
            assert b" Tf" in b"".join(map(inflated, streams))
        else:
            root = ElementTree.parse(path).getroot()
            assert float(root.get("width", "").removesuffix("pt")) == pytest.approx(
                72.0 * width, 0.01
            )
            texts = texts_of_svg(path)
            assert "Ki, N/m" in texts
            assert ("The title" in texts) is not style.paper
            assert ("best point" in texts) is not style.paper
            if style.paper:
                sizes = re.findall(r"font(?:-size)?: (?:\w+ )*?([\d.]+)px", path.read_text())
                assert set(map(float, sizes)) == {8.0}


def inflated(stream: bytes) -> bytes:
    """Return a stream of a PDF uncompressed; empty for one that is not compressed so."""
    try:
        return zlib.decompress(stream)
    except zlib.error:
        return b""


def test_the_style_ends_with_its_context(tmp_path: Path) -> None:
    with drawn_as(DrawStyle(True, format="svg")):
        assert picture.for_paper()
    assert not picture.for_paper()
    assert draw(tmp_path / "surface.pdf").suffix == ".pdf"


def test_options_and_styles_have_the_same_formats() -> None:
    assert FORMATS == picture.FORMATS
