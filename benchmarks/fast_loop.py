"""The real-time loop with its plant at 4 kHz, beside cyclictest at the same period."""

import shutil
import tempfile
from pathlib import Path

from benchmarks.lateness import NO_CYCLICTEST, alternate_blocks, timing_figures
from benchmarks.support.result import Result, figure

RATE_HZ = 4000
MIN_EXECUTED = 99.5  # % of the periods
_BLOCK_S = 10.0


def measure(short: bool) -> Result:
    """Alternate blocks of a rehearsal on the real clock at 4 kHz and of cyclictest."""
    pairs = 1 if short else 6
    has_cyclictest = shutil.which("cyclictest") is not None
    with tempfile.TemporaryDirectory() as scratch:
        blocks = alternate_blocks(
            Path(scratch),
            _BLOCK_S,
            pairs,
            busy=False,
            has_cyclictest=has_cyclictest,
            rate_hz=RATE_HZ,
        )
    periods = _BLOCK_S * RATE_HZ
    executed = [100.0 * block.lateness.wakes / periods for block in blocks.loop]
    together = sum(executed) / len(executed)  # they are equally long
    refused = sorted({reason for block in blocks.loop for reason in block.refused})
    return Result(
        "fast_loop",
        "a WaveBot rehearsed on the real clock at 4 kHz, with plant, log and compiled tick",
        f"{pairs} blocks of {_BLOCK_S:g} s from the first tick, each beside one of cyclictest at "
        "the same period",
        (
            figure(
                "executed of elapsed, all blocks together", "%", together, at_least=MIN_EXECUTED
            ),
            figure("of each block", "%", executed),
            *timing_figures("4 kHz", blocks),
        ),
        (
            "the targets are those of a quiet host: other work and stolen time stand below",
            *(() if has_cyclictest else (NO_CYCLICTEST,)),
            *(f"not granted to the loop: {reason}" for reason in refused),
        ),
    )
