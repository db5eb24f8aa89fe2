"""Named faults of one emulated device, switched while it runs."""

from __future__ import annotations

from collections.abc import Mapping


class DeviceFaults:
    """The faults of a device and which of them are on; all are off at first."""

    def __init__(self, descriptions: Mapping[str, str]) -> None:
        """`descriptions`: name of each fault, and the device's behaviour while it is on."""
        self._descriptions = dict(descriptions)
        self._on: set[str] = set()

    def descriptions(self) -> dict[str, str]:
        """Return every fault of this device: name and visible effect."""
        return dict(self._descriptions)

    def switch(self, name: str, on: bool = True) -> None:
        """Switch one fault; raises ValueError for a name that is not listed."""
        if name not in self._descriptions:
            raise ValueError(
                f"no fault {name!r}; there are {', '.join(sorted(self._descriptions))}"
            )
        if on:
            self._on.add(name)
        else:
            self._on.discard(name)

    def clear(self) -> None:
        """Switch all faults off."""
        self._on.clear()

    def is_on(self, name: str) -> bool:
        """Return whether a fault is on; False also for a fault that this device does not have."""
        return name in self._on
