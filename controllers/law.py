"""The interface of a control law: a module of pure functions that an axis calls once a tick.

A law module defines

    COLUMNS      a `Column` for each field of ``SetPoint``, in order: the columns that the law
                 adds to the gain matrix
    PARAMETERS   a `Parameter` for each constant that the campaign file gives below ``law:``
    SetPoint     NamedTuple of floats: the set point of a row
    Params       NamedTuple: constants of a run
    State        NamedTuple: memory from tick to tick

    params(settings, ramp, dt) -> Params          ValueError for settings that do not fit together
    start(params) -> State                        before the first tick, and after every stop
    step(params, state, setpoint, motion, reference, deficit, dt) -> (State, Demand)

and may define

    linear(params, setpoint, omega) -> complex    force per velocity (N*s/m) at omega (rad/s), for
                                                  predictions; only if the law is linear

``step`` returns the force on the body (N, up positive). ``motion`` is the estimated motion,
``reference`` an open-loop force (N) that the law adds, ``deficit`` the force (N) that the limits
granted less than the law demanded in the tick before, ``dt`` the period (s). Signs: F = Kp v + Ki x
on the body, so Kp < 0 absorbs and Ki > 0 acts as a negative spring (MASK4 report (Sandia), section
4.3).

``step`` runs interpreted in the loop and compiled in sweeps, to the same bit. So a law keeps to
plain Python on floats: no ``**``, no ``_replace``, no ``hypot`` or ``fmod``, float literals, tables
as tuples, and it tests the domain of a division, root or logarithm before it computes it. It keeps
no memory outside ``State``.
"""

from typing import NamedTuple


class Column(NamedTuple):
    """A quantity that a law lets the gain matrix vary from row to row."""

    key: str  # in files, with its unit: ``kp_n_s_per_m``
    name: str  # of the field of SetPoint and in the row table: ``kp``
    unit: str  # SI: ``N*s/m``
    label: str  # on axes: ``Kp``
    low: float  # least value allowed
    high: float  # greatest value allowed
    help: str  # one sentence for people
    reason: str = ""  # of the range, for messages about values out of it
    default: float | None = None  # where a matrix lacks the column; None: every matrix has it
    choices: tuple[str, ...] = ()  # names that stand for the values 0, 1, ...; files may use them
    laws: tuple[str, ...] = ()  # of a choice, those with the column, if not all; not given by laws


class Parameter(NamedTuple):
    """A constant of a law in the campaign file: a number, or a list of numbers."""

    key: str  # in files, with its unit
    unit: str  # SI
    low: float  # least value allowed
    high: float  # greatest value allowed
    help: str  # one sentence for people
    default: tuple[float, ...] = ()  # one number, or those of a list; empty: the file must give it
    listed: bool = False  # a list of numbers, not one


Settings = dict[str, tuple[float, ...]]
"""Values of a law's parameters by key: one number, or those of a list."""
