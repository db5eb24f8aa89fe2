"""First files of a rig, derived from the coefficients of a BEM file.

The campaign is a grid around the impedance match at one wave frequency; the limits follow from the
motion and the force of its rows by linear theory, motor and gear from that force
(`first_values`). They are values to begin with: the texts mark what a laboratory has to choose.
"""

import math
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from controllers import impedance
from rig.config.law_settings import IMPEDANCE
from rig.config.problems import format_number
from rig.kinds.modular.columns import axis_law
from rig.kinds.modular.first_values import (
    MARGIN,
    STANDBY,
    AxisGrid,
    FirstValues,
    first_pto,
    first_values,
    largest_jump,
)
from rig.kinds.modular.mode_choice import ChosenModes, ModeOptions, choose_modes
from rig.kinds.modular.plant_text import (
    PlantEntries,
    Pto,
    band_text,
    force_sensors,
    fragment,
    plant_text,
    power_sensors,
    rounded,
)
from rig.kinds.new_files import write_new
from sim_plant.modes.bem import bem_files

__all__ = ["Options", "write_rig"]

TEXTS = ("rig", "limits", "plant", "campaign", "rig_hil", "limits_hil")

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}")
_PERIODS = 10  # of the waves, measured in each row
_FIRST_NODE = 5  # of the drives on CAN


class Options(NamedTuple):
    """Options of `rig new rig`; None is derived."""

    modes: ModeOptions
    frequency: float | None = None  # Hz, of the waves
    amplitude: float | None = None  # m, of the waves
    torque_constant: float | None = None  # N*m/A
    gear_ratio: float | None = None  # rad/m or 1


def write_rig(name: str, folder: Path, options: Options) -> list[Path]:
    """Write the files of a new rig into ``folder/name``, and return their paths.

    A copy of the BEM file, unless it is in that folder, lets the folder be moved.

    Raises ValueError with every reason why they cannot be derived or written; OSError for a BEM
    file that cannot be read.
    """
    folder, bem = folder / name, options.modes.bem
    problems = [*_option_problems(name, options)]
    problems += [
        f"{path}: exists; nothing is overwritten"
        for path in (folder / f"{text}.yaml" for text in TEXTS)
        if path.exists()
    ]
    chosen = choose_modes(options.modes, problems, restored=True)
    values = first_values(chosen, options.frequency, options.amplitude)
    _check_values(bem, values)
    texts = file_texts(name, folder, options, chosen, values)
    found: dict[Path, str | bytes] = {folder / f"{file}.yaml": text for file, text in texts.items()}
    return write_new(found | bem_copies(bem, folder))


def _option_problems(name: str, options: Options) -> Iterator[str]:
    if not _NAME.fullmatch(name):
        yield (
            f"{name!r} cannot be the name of a rig and its folder; allowed [A-Za-z][A-Za-z0-9_-]*, "
            "at most 40 characters"
        )
    for key in ("frequency", "amplitude", "torque_constant", "gear_ratio"):
        value = getattr(options, key)
        if value is not None and not (value > 0.0 and math.isfinite(value)):
            yield f"--{key.replace('_', '-')} {value:g}: allowed above 0"


def _check_values(bem: Path, values: FirstValues) -> None:
    """Raise ValueError for an axis that no wave excites, or whose match is beyond the law."""
    problems = []
    columns = {column.name: column for column in impedance.COLUMNS}
    for name, grid in values.axes.items():
        if not grid.velocity > 0.0:
            problems.append(f"waves of {values.linear.frequency:.3g} Hz do not excite {name}")
        for column, gains in ((columns["kp"], grid.kp), (columns["ki"], grid.ki)):
            if not (column.low <= min(gains) and max(gains) <= column.high):
                worst = max(gains, key=abs)
                problems.append(
                    f"the impedance match of {name} needs {column.label} = {format_number(worst)}; "
                    f"allowed {format_number(column.low)} .. {format_number(column.high)}: a body "
                    "larger than one of a test rig; scale the BEM data to the size of the model"
                )
    if problems:
        raise ValueError("\n".join(f"{bem}: {each}" for each in problems))


def file_texts(
    name: str, folder: Path, options: Options, chosen: ChosenModes, values: FirstValues
) -> dict[str, str]:
    """Return the text of each file in `TEXTS`."""
    ptos = {
        axis: first_pto(chosen.axes[axis], grid, options.torque_constant, options.gear_ratio)
        for axis, grid in values.axes.items()
    }
    numbers = {
        axis: _axis_numbers(axis, ptos[axis], grid, values) for axis, grid in values.axes.items()
    }
    sensors, cells = power_sensors(ptos), force_sensors(ptos)
    common = _common_texts(name, chosen, values)

    def parts(template: str) -> str:
        return "".join(
            fragment(
                template,
                rotary=pto.motion.rotates,
                **numbers[axis],
                node=str(node),
                force_sensor=cells[axis],
                label=cells[axis].replace("_", " "),
                force_unit="N*m" if pto.motion.rotates else "N",
            )
            for node, (axis, pto) in enumerate(ptos.items(), _FIRST_NODE)
        )

    meters = {sensor: sensor.replace("dc_power", "dc") for sensor in sensors.values()}
    meters |= {sensor: sensor for sensor in cells.values()}
    by_file = {
        "rig": {
            "axes": parts("rig_axis"),
            "sensors": "".join(
                fragment(
                    "rig_sensor", sensor=sensor, power_range=numbers[axis]["power_range"],
                    label="DC power" if len(ptos) == 1 else f"DC power of {axis}",
                )
                for axis, sensor in sensors.items()
            ) + parts("rig_force_sensor"),
            "absorbed": " + ".join(f"{cells[axis]} * {axis}_velocity" for axis in ptos),
            "sensor_label": (
                next(iter(cells.values())).replace("_", " ") if len(cells) == 1 else "force sensors"
            ),
            "mechanical": " + ".join(f"{axis}_force * {axis}_velocity" for axis in ptos),
            "electric": " + ".join(sensors.values()),
        },
        "limits": {"axes": parts("limits_axis")},
        "limits_hil": {"axes": parts("limits_hil_axis")},
        "rig_hil": {
            "axes": parts("rig_hil_axis"),
            "sources": "".join(
                f"  {sensor}: {{source: meter.{meter}}}    # a value of the wiring below\n"
                for sensor, meter in meters.items()
            ),
            "meter_size": str(2 * len(meters)),
            "meter_values": "".join(
                f"        - {{name: {meter}, at: {2 * place}, kind: f32}}\n"
                for place, meter in enumerate(meters.values())
            ),
        },
        "campaign": {
            "impedances": _wrapped(f"# {values.linear.reason}\n" + parts("campaign_axis")),
            "matrix": _matrix(chosen, values),
        },
    }  # fmt: skip
    entries = PlantEntries(
        bem_key(options.modes.bem, folder), _band(chosen), options.modes.water,
        options.modes.direction, None, chosen.modes, ptos,
    )  # fmt: skip
    rotary = all(pto.motion.rotates for pto in ptos.values())
    files = {file: fragment(file, rotary=rotary, **common, **own) for file, own in by_file.items()}
    return {**files, "plant": plant_text(name, entries)}


def _wrapped(comment: str) -> str:
    """Return a comment of several lines in lines of full length."""
    text = comment.replace("\n# ", " ").removeprefix("# ")
    lines = textwrap.wrap(text, 98, break_on_hyphens=False)
    return "\n".join(f"# {line}" for line in lines)


def _band(chosen: ChosenModes) -> tuple[float, float]:
    frequency = chosen.bem.frequency
    return float(frequency[0]), float(frequency[-1])


def _matrix(chosen: ChosenModes, values: FirstValues) -> str:
    """Return the gain matrix as YAML: a grid of one axis, a list of the rows of several."""
    several = len(values.axes) > 1
    keys = {}
    for axis, motion in chosen.axes.items():
        columns = axis_law(IMPEDANCE, axis if several else "", rotates=motion.rotates).columns
        keys[axis] = [column.key for column in columns[:2]]
    grids = list(values.axes.values())
    if not several:
        ((kp, ki),), (grid,) = keys.values(), grids
        gains = [", ".join(map(format_number, dict.fromkeys(each))) for each in (grid.kp, grid.ki)]
        return f"  grid:\n    - {kp}: [{gains[0]}]\n      {ki}: [{gains[1]}]"
    rows = [
        ", ".join(
            f"{kp}: {format_number(grid.kp[p])}, {ki}: {format_number(grid.ki[i])}"
            for (kp, ki), grid in zip(keys.values(), grids, strict=True)
        )
        for p in range(len(grids[0].kp))
        for i in range(len(grids[0].ki))
    ]
    return "\n".join(["  list:", *(f"    - {{{row}}}" for row in dict.fromkeys(rows))])


def bem_key(bem: Path, folder: Path) -> str:
    """Return the path of a BEM file, or of its copy, as a plant file in a folder names it."""
    first = bem_files(bem)[0].resolve()
    root = folder.resolve() if first.is_relative_to(folder.resolve()) else _copied_root(bem)
    return first.relative_to(root).as_posix()


def bem_copies(bem: Path, folder: Path) -> dict[Path, bytes]:
    """Return the files of BEM results as copies in a folder, without those that are there."""
    files = [each.resolve() for each in bem_files(bem)]
    if files[0].is_relative_to(folder.resolve()):
        return {}
    copies = {folder / each.relative_to(_copied_root(bem)): each.read_bytes() for each in files}
    return {
        path: content
        for path, content in copies.items()
        if not path.is_file() or path.read_bytes() != content
    }


def _copied_root(bem: Path) -> Path:
    """Return the folder to which the paths of copies are relative: a Nemoh run keeps its own."""
    files = [each.resolve() for each in bem_files(bem)]
    alone = all(each.parent == files[0].parent for each in files)
    return files[0].parent if alone else files[0].parent.parent


def _common_texts(name: str, chosen: ChosenModes, values: FirstValues) -> dict[str, str]:
    """Return the texts of the placeholders that do not belong to an axis."""
    period = 1.0 / values.linear.frequency
    settle, measured = rounded(8.0 * period), _PERIODS * period
    numbers = {
        "margin": MARGIN,
        "amplitude": values.amplitude,
        "frequency": values.linear.frequency,
        "settle": settle,
        "interval": math.ceil(10.0 * (settle + measured)) / 10.0,
        "lead_in": rounded(max(30.0, 12.0 * period)),
    }
    return {
        **{key: format_number(value) for key, value in numbers.items()},
        "title": f"{name}, {', '.join(chosen.axes)}",
        "name": name,
        "campaign": f"{name}-first",
        "periods": str(_PERIODS),
        "bem_range": band_text(_band(chosen)),
    }


def _axis_numbers(axis: str, pto: Pto, grid: AxisGrid, values: FirstValues) -> dict[str, str]:
    """Return the texts of an axis's placeholders."""
    omega, z = values.omega, grid.impedance
    stop, speed = MARGIN * grid.position, MARGIN * grid.velocity
    peak_force = MARGIN * grid.force
    peak = peak_force / (pto.torque_constant * pto.gear_ratio)  # A
    jerk = omega * omega * grid.velocity
    match = -omega * z.imag
    numbers = {
        "torque_constant": pto.torque_constant,
        "gear_ratio": pto.gear_ratio,
        "jerk_density": min(max(0.05 * jerk * jerk, 1e-4), 1e6),
        "stop_damping": abs(z),
        "power_range": MARGIN * (peak_force * speed + STANDBY),
        "position_warn": 0.8 * stop,
        "position_stop": stop,
        "velocity_stop": speed,
        "current_peak": peak,
        "current_rms": 0.75 * peak,
        "force_slew": peak_force / 0.02,
        "encoder_jump": largest_jump(grid),
        "current_difference": 0.2 * peak,
        "tare_span": min(0.1 * stop, 0.5),
        "current_limit": pto.current_limit,
        "force_range": 2.0 * pto.peak_force,
        "resistance_z": z.real,
        "reactance_z": abs(z.imag),
        "kp_match": -z.real,
        "ki_match": match,
        "kp_passive": -abs(z),
    }
    unit = "N*m/rad" if pto.motion.rotates else "N/m"
    reason = "The full match moves far, so Ki goes half-way here."
    if grid.ki_limit < match:
        limit = format_number(rounded(grid.ki_limit))
        reason = (
            f"Above Ki = {limit} {unit}, the static stiffness, there is no "
            "equilibrium, so Ki goes to half of that here."
        )
    others = "" if len(values.axes) == 1 else " (the other axes with their best damping)"
    return {
        **{key: format_number(rounded(value)) for key, value in numbers.items()},
        "frequency": format_number(values.linear.frequency),
        "axis": axis,
        "sign_z": "-" if z.imag < 0.0 else "+",
        "counts": str(pto.counts),
        "ki_reason": reason,
        "others": others,
    }
