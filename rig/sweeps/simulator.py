"""Interface of sweeps to a kind of rig: the rooms `campaign` and `simulation` of its package.

The room `simulation` of a kind with campaigns is a `Simulation`, of one with sessions a
`SessionSimulation`.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Protocol

from rig.campaign import AnyCampaign, AnyPlan, CampaignKind, CampaignParts
from rig.campaign.equilibrium import EquilibriumCheck
from rig.campaign.simulated_rows import RowSimulation
from rig.config.problems import Problem
from rig.config.yaml_source import KeyPath
from rig.identification.incident_waves import WaveDevice
from rig.kinds import registry
from rig.planning.input_files import InputFile, MappingLoader
from rig.realtime import cycle
from rig.row_contents import RowContents

ROOM = "simulation"
CAMPAIGN_ROOM = "campaign"


class Simulator(Protocol):
    """A rig and its simulated plant; each simulation starts anew. Threads may share a simulator."""

    def is_compiled(self) -> bool:
        """Return whether this host has the code of loop and plant already."""

    def prepare(self) -> None:
        """Load the code; compile it if this host does not have it, which takes a minute.

        Raises ValueError if it cannot be compiled.
        """


class CampaignSimulator(Simulator, Protocol):
    """A campaign's rig in its sea."""

    kind: cycle.Kind
    """The kind's cycle, whose rows the simulation reduces."""

    def simulate(
        self, plan: AnyPlan, check: Callable[[], None] = ..., place: float | None = None
    ) -> RowSimulation:
        """Return the simulation of a plan from power-on to its end or a trip.

        The simulation calls ``check`` many times per second; an exception of it ends the
        simulation. ``place`` is the position at power-on of the part that moves between rows.
        """


class SessionSimulator(Simulator, Protocol):
    """A session's rig."""

    def results(self, check: Callable[[], None]) -> tuple[dict[str, Any], float]:
        """Return the results of a simulated session by name, and its duration, s.

        Results are `state` and `incomplete_reason` as of a row, further texts, and numbers; `units`
        holds the unit of each number, and ``NAME_uncertainty`` the half width of its 95 % interval.
        ``check`` is that of a campaign. Raises ValueError for a session without results.
        """


class SessionSimulation(Protocol):
    """The simulation of the sessions of a kind of rig: a module of its package."""

    SESSION_KEYS: tuple[str, ...]
    """Keys of a session file that may be swept."""

    def matching_keys(self, rig: Mapping[str, Any]) -> Mapping[KeyPath, KeyPath]:
        """Return the keys as of `Simulation`."""

    def open_session(self, path: Path, load: MappingLoader) -> Any:
        """Return a session with `file`, `plant` and `files`; ``load`` reads its files and may
        change their values. Raises `ConfigError` with every problem, those of the plant, too."""

    def resolved_session(self, session: Any) -> str:
        """Return JSON text with every key of every file, that of the session as `session`."""

    def open_simulator(self, session: Any) -> SessionSimulator:
        """Return the simulator of a session."""


class Simulation(Protocol):
    """The simulation of the campaigns of a kind of rig: a module of its package."""

    def matching_keys(self, rig: Mapping[str, Any]) -> Mapping[KeyPath, KeyPath]:
        """Return the keys of an unchecked rig file and those of the plant file that must have the
        same value."""

    def row_contents(self, campaign: AnyCampaign) -> RowContents:
        """Return the contents of the rows' results; their first station is at the body."""

    def problems(self, parts: CampaignParts) -> tuple[Problem, ...]:
        """Return all problems that would keep loop or plant from starting."""

    def plant_unit(self, campaign: AnyCampaign, path: KeyPath) -> str:
        """Return the unit of a plain number of the plant file at a key; empty if it has none."""

    def plant_data(self, campaign: AnyCampaign) -> tuple[InputFile, ...]:
        """Return the data files that the plant file names."""

    def open_simulator(
        self, campaign: AnyCampaign, plan: AnyPlan, sea: dict[str, Any] | None = None
    ) -> CampaignSimulator:
        """Return the simulator of a campaign; ``sea`` replaces that of the campaign."""

    def equilibrium_check(self, campaign: AnyCampaign) -> EquilibriumCheck:
        """Return the check whether a set point leaves the body an equilibrium."""

    def sweep_problems(self, campaign: AnyCampaign) -> Iterable[Problem]:
        """Return the reasons why the rows of a valid campaign cannot be simulated."""

    def check_model(self, run: str, logged: AnyCampaign, model: AnyCampaign) -> None:
        """Raise ValueError if the campaign of a recorded run had another device than a model."""

    def requested_sea(self, campaign: AnyCampaign) -> dict[str, Any]:
        """Return the spectral lines that the wave maker is to make, as in a run's plan."""

    def wave_device(self, campaign: AnyCampaign) -> WaveDevice:
        """Return the model of the device from whose motion waves are recovered."""

    def identified_range(self, campaign: AnyCampaign) -> dict[str, tuple[float, float]]:
        """Return the range of amplitudes in which the campaign's plant was identified; empty if
        unknown."""


def campaign_kind(kind: registry.RigKind) -> CampaignKind:
    """Return what a kind of rig adds to campaigns; KindError for a kind without campaigns."""
    try:
        found: CampaignKind = kind.room(CAMPAIGN_ROOM).CAMPAIGNS
    except registry.KindError as error:
        message = f"campaigns of kind {kind.name} cannot be swept: {error}"
        raise registry.KindError(message) from None
    return found


def simulation_of(campaign: AnyCampaign) -> Simulation:
    """Return the simulation of a campaign's kind of rig; KindError if the kind has none."""
    return _simulation(campaign.rig.kind)


def session_simulation(kind: registry.RigKind) -> SessionSimulation | None:
    """Return the simulation of a kind's sessions; None if it has none."""
    try:
        room = kind.room(ROOM)
    except registry.KindError:
        return None
    return room if hasattr(room, "open_session") else None


def simulation_of_rig(mapping: Mapping[str, Any]) -> Simulation | SessionSimulation | None:
    """Return the simulation of an unchecked rig file's kind; None for a kind that is not known."""
    kind = mapping.get("kind")
    return _simulation(kind) if isinstance(kind, str) and kind in registry.known() else None


def problems(parts: CampaignParts) -> tuple[Problem, ...]:
    """Return the simulation's problems of a campaign; none if its rig file names no known kind."""
    simulation: Any = None if parts.rig is None else simulation_of_rig(parts.rig.mapping)
    return () if simulation is None else simulation.problems(parts)


def _simulation(kind: str) -> Simulation:
    simulation: Simulation = registry.find(kind).room(ROOM)
    return simulation
