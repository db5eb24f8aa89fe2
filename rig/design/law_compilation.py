"""Trial compilation of a law, with numba's reason if it fails."""

from collections.abc import Iterable
from typing import Any

from controllers.signals import Demand, Estimate
from rig.compilation import lifting
from rig.compilation.cache_folder import cached_json, code_folder
from rig.compilation.tick_source import all_of
from rig.design.law_params import law_params
from rig.laws import Law

_RAMP = 0.1  # s; the compiled code does not depend on it


def compilation_problem(law: Law, settings: Any, dt: float) -> str:
    """Return in one line why a law with its settings cannot be compiled; empty if it can.

    The answer is kept for the law's source, because compiling takes seconds. ``dt``: s.
    """
    needed = all_of([law.module.step])
    source = repr((law.sha256, law.module.SetPoint._fields, needed.digest))
    path = code_folder(source, needed.modules) / "compilation.json"
    answer = cached_json(
        path,
        lambda: {"problem": _compile(law, settings, dt, needed.functions)},
        lambda answer: "problem" in answer,
    )
    return str(answer["problem"])


def _compile(law: Law, settings: Any, dt: float, functions: Iterable[Any]) -> str:
    params = law_params(law, settings, _RAMP, dt)
    state = law.module.start(params)
    set_point = law.module.SetPoint(*(0.0 for _ in law.columns))
    lifting.lift_functions(functions)
    step = law.module.step

    def ticks(params: Any, state: Any, set_point: Any, motion: Any, dt: float) -> Demand:
        # In a loop, so that the state must have the types of the one before.
        demand = Demand(0.0, 0.0, 0.0, 0.0)
        for _ in range(2):
            state, demand = step(params, state, set_point, motion, 0.0, 0.0, dt)
        return demand

    return lifting.compilation_problem(ticks, params, state, set_point, Estimate(0.1, 0.2, 0.3), dt)
