"""The WaveBot's formats of `rig export` (`rig.kinds.interface.Exports`)."""

from pathlib import Path

from rig.kinds.wavebot.mask4.export import export_structure, write_mat


def _write_mask4(run: Path, rate: float | None, path: Path) -> tuple[str, ...]:
    """Write the MASK4 MATLAB structure of a run."""
    exported = export_structure(run, rate)
    write_mat(exported, path)
    return exported.remarks


FORMATS = {"mat": _write_mask4}
