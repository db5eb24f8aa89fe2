"""Base class and field types of all models of configuration files."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Annotated, Any, ClassVar, NamedTuple, Self, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from rig.config.problems import format_number
from rig.config.yaml_source import KeyPath

RULE = "rule"  # type of the pydantic errors raised here; `pydantic_errors` keeps their text


class Reason(NamedTuple):
    """The reason for the limits of a range; messages about the range include it."""

    text: str


class RuleViolation(NamedTuple):
    """A violated rule between several keys, reported at one of them."""

    key: KeyPath  # within the model
    message: str
    value: object = None


class FileModel(BaseModel):
    """A frozen mapping of a configuration file.

    Unknown keys, text in place of numbers, NaN and infinity are refused. Integers become floats
    where the field is a float. All violated rules between keys are reported at once.
    """

    model_config = ConfigDict(
        frozen=True,
        strict=True,
        extra="forbid",
        allow_inf_nan=False,
        validate_default=True,
        defer_build=True,
    )

    foreign_keys: ClassVar[dict[str, str]] = {}
    """Keys that belong to another model, each with the hint for the error message."""

    inline: ClassVar[tuple[str, ...]] = ()
    """Keys whose value may be the name of a file that holds the mapping."""

    def check_rules(self) -> Iterator[RuleViolation]:
        """Yield the violated rules between keys; called only if each key by itself is valid."""
        yield from ()

    def violation(self, key: str, message: str) -> RuleViolation:
        """Return the violation of a rule by the value of a key."""
        return RuleViolation((key,), message, getattr(self, key))

    def check_one_of(self, *keys: str, missing: str) -> Iterator[RuleViolation]:
        """Check that exactly one of the keys is given; ``missing``: the message for none."""
        given = [key for key in keys if getattr(self, key) is not None]
        if not given:
            yield RuleViolation((), missing)
        for key in given[1:]:
            yield self.violation(key, f"{given[0]} is given already; allowed one of them")

    def check_below(self, low: str, high: str) -> Iterator[RuleViolation]:
        """Check that the value of key ``low`` is below that of key ``high``."""
        low_value, high_value = getattr(self, low), getattr(self, high)
        if not low_value < high_value:
            text = f"{format_number(low_value)} is not below {high} = {format_number(high_value)}"
            yield RuleViolation((low,), text, low_value)

    @staticmethod
    def check_rising(
        values: Sequence[float], key: KeyPath, *column: str, of: str = ""
    ) -> Iterator[RuleViolation]:
        """Check that the values of the list at ``key`` rise; ``of`` ends the message.

        ``column`` is the key of a value in an entry of the list.
        """
        for i, (previous, value) in enumerate(pairwise(values), 1):
            if value <= previous:
                text = f"{format_number(value)} does not rise above {format_number(previous)}{of}"
                yield RuleViolation((*key, i, *column), text, value)

    @staticmethod
    def check_monotone(
        values: Sequence[float], key: KeyPath, *column: str, rule: str
    ) -> Iterator[RuleViolation]:
        """Check that values keep the direction of the first two, which ``rule`` has in braces."""
        falling = values[1] < values[0]
        for i, (previous, value) in enumerate(pairwise(values), 1):
            if value == previous or falling != (value < previous):
                text = f"{format_number(value)} after {format_number(previous)}: "
                text += rule.format("fall" if falling else "rise")
                yield RuleViolation((*key, i, *column), text, value)

    @model_validator(mode="after")
    def _apply_rules(self) -> Self:
        violations = tuple(self.check_rules())
        if violations:
            context = {"text": violations[0].message, "rules": violations}
            raise PydanticCustomError(RULE, "{text}", context)
        return self


def rule_error(message: str, *key: str | int) -> PydanticCustomError:
    """Return the error for a validator to raise, reported at ``key`` below the validated value."""
    rules = (RuleViolation(key, message),)
    return PydanticCustomError(RULE, "{text}", {"text": message, "rules": rules})


def _to_integer(value: Any) -> Any:
    # 1e3 is a float in YAML 1.2, but the person who wrote it means an integer.
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value


T = TypeVar("T")
TupleOf = Annotated[tuple[T, ...], Field(strict=False)]
"""A list in the file, a tuple in the model."""

WholeNumber = Annotated[int, BeforeValidator(_to_integer)]
"""An integer, which the file may also write as 1e3."""
