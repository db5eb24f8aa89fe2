"""The page of trip reasons, from the enumerations of the core and of the kinds of rig."""

from docs.generate.markdown import code, sentence, table
from rig.kinds import registry
from rig.realtime.reasons import CORE_REASONS, TripReason

_HEAD = """# Trip reasons

A run that stops records the reason: its number in every log row (`safety.reason`), its name in
`rig show`. A stop of category 1 brings the device to rest under damping, then removes power. A stop
of category 0 removes power at once.

"""


def page() -> str:
    """Return the page: reasons of every rig, then those that only a kind of rig has."""
    parts = [_HEAD, "## Every rig\n\n", _table(CORE_REASONS)]
    for name in registry.OWN_PACKAGES:
        every = registry.find(name).room("tick").find_kind("").reason_table.reasons
        own = tuple(each for each in every if each not in CORE_REASONS)
        if own:
            parts += [f"\n## Kind `{name}`\n\n", _table(own)]
    return "".join(parts)


def _table(reasons: tuple[TripReason, ...]) -> str:
    rows = (
        [each.number, code(each.name), each.category, sentence(each.text), sentence(each.advice)]
        for each in reasons
    )
    return table(["number", "name", "stop category", "meaning", "what to do"], rows)
