"""A column of numbers that compiled code indexes like a tuple, independent of its length.

A tuple's length is part of its compiled type, so every plan would be compiled again. Numba counts
references of an array in a NamedTuple at every use, which triples the time of a tick. A column is a
pointer and a length (`rig.compilation.column_type`). It must outlive the compiled code's use of it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt


class Column:
    """Numbers of one type, all int or all float."""

    def __init__(self, numbers: Sequence[float] | npt.NDArray[np.float64]) -> None:
        """Wrap numbers; an array is not copied, so that compiled code can write to it."""
        if isinstance(numbers, np.ndarray):
            self.array: npt.NDArray[Any] = np.ascontiguousarray(numbers, np.float64)
        else:
            integers = len(numbers) > 0 and all(
                isinstance(one, int | np.integer) for one in numbers
            )
            self.array = np.array(numbers, np.int64 if integers else np.float64)
        self.address = int(self.array.ctypes.data)
        self.length = len(self.array)
        self.code = "q" if self.array.dtype == np.int64 else "d"

    def __len__(self) -> int:
        return self.length

    def __getitem__(self, index: int) -> float:
        number: float = self.array[index].item()
        return number

    def __setitem__(self, index: int, number: float) -> None:
        self.array[index] = number


def prefetch(column: Any, index: int) -> None:
    """Prefetch an entry into the cache; an index out of range has no effect."""
