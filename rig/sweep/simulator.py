"""What a sweep needs of a kind of rig: the room `simulation` of the kind's package."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

from rig import kinds
from rig.config.problems import Problem
from rig.config.yaml_source import KeyPath
from rig.identification.incident_waves import WaveDevice
from rig.kinds.wavebot.campaign import Campaign, CampaignParts, InputFile, Plan
from rig.laws import Law
from rig.recording.runs.windows import Window
from rig.row_contents import RowContents

ROOM = "simulation"


class RowSimulation(Protocol):
    """Iterator over the measured windows of a plan's rows; then ``reason`` is that of its end."""

    reason: str

    @property
    def seconds(self) -> float:
        """Simulated time so far, s."""
        ...

    def __iter__(self) -> Iterator[Window]:
        """Yield the window of each measured row; its data are valid until the next one."""
        ...


class CampaignSimulator(Protocol):
    """A campaign's rig in its sea; each simulation starts anew. Threads may share a simulator."""

    def prepare(self, plan: Plan) -> None:
        """Compile the loop for this campaign, or read it from the cache."""
        ...

    def simulate(
        self, plan: Plan, check: Callable[[], None] = ..., stator: float | None = None
    ) -> RowSimulation:
        """Return the simulation of a plan from power-on to its end or a trip.

        The simulation calls ``check`` several times per second; an exception of it ends the
        simulation. ``stator`` is the stator's position at power-on (%).
        """
        ...


class Simulation(Protocol):
    """The simulation of a kind of rig: a module of its package."""

    MATCHING_KEYS: Mapping[KeyPath, KeyPath]
    """Keys of the rig file and keys of the plant file that must have the same value."""

    def row_contents(self, campaign: Campaign) -> RowContents:
        """Return the contents of the rows' results; their first station is at the body."""
        ...

    def problems(self, parts: CampaignParts) -> tuple[Problem, ...]:
        """Return all problems that would keep loop or plant from starting."""
        ...

    def plant_data(self, campaign: Campaign) -> tuple[InputFile, ...]:
        """Return the data files that the plant file names."""
        ...

    def open_simulator(
        self, campaign: Campaign, plan: Plan, sea: dict[str, Any] | None = None
    ) -> CampaignSimulator:
        """Return the simulator of a campaign; ``sea`` replaces that of the campaign."""
        ...

    def is_compiled(self, law: Law) -> bool:
        """Return whether this host has already compiled the loop with a law."""
        ...

    def requested_sea(self, campaign: Campaign) -> dict[str, Any]:
        """Return the spectral lines that the wave maker is to make, as in a run's plan."""
        ...

    def wave_device(self, campaign: Campaign) -> WaveDevice:
        """Return the model of the device from whose motion waves are recovered."""
        ...

    def identified_range(self, campaign: Campaign) -> dict[str, tuple[float, float]]:
        """Return the range of amplitudes in which the campaign's plant was identified; empty if
        unknown."""
        ...


def simulation_of(campaign: Campaign) -> Simulation:
    """Return the simulation of a campaign's kind of rig; KindError if the kind has none."""
    return _simulation(campaign.rig.kind)


def simulation_of_rig(mapping: Mapping[str, Any]) -> Simulation | None:
    """Return the simulation of an unchecked rig file's kind; None for a kind that is not known."""
    kind = mapping.get("kind")
    return _simulation(kind) if isinstance(kind, str) and kind in kinds.known() else None


def problems(parts: CampaignParts) -> tuple[Problem, ...]:
    """Return the simulation's problems of a campaign; none if its rig file names no known kind."""
    simulation = None if parts.rig is None else simulation_of_rig(parts.rig.mapping)
    return () if simulation is None else simulation.problems(parts)


def _simulation(kind: str) -> Simulation:
    simulation: Simulation = kinds.find(kind).room(ROOM)
    return simulation
