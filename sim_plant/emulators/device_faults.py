"""Named faults of one emulated device, switched while it runs."""

from __future__ import annotations

from collections.abc import Mapping


class DeviceFaults:
    """Which of a device's listed faults are on; all are off at first."""

    def __init__(self, listed: Mapping[str, str]) -> None:
        """`listed`: name of each fault and what the device does while it is on."""
        self._listed = dict(listed)
        self._on: set[str] = set()

    def listed(self) -> dict[str, str]:
        """Give every fault this device can have: name and what is seen of it."""
        return dict(self._listed)

    def switch(self, name: str, on: bool = True) -> None:
        """Switch one fault; raises ValueError for a name that is not listed."""
        if name not in self._listed:
            raise ValueError(f"no fault {name!r}; there are {', '.join(sorted(self._listed))}")
        if on:
            self._on.add(name)
        else:
            self._on.discard(name)

    def clear(self) -> None:
        """Switch all faults off."""
        self._on.clear()

    def on(self, name: str) -> bool:
        """Say whether a fault is on; False too for one this device does not have."""
        return name in self._on
