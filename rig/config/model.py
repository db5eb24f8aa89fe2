"""What every model of a configuration file has in common."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, NamedTuple, Self, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from rig.config.yaml_source import KeyPath

RULE = "rule"  # type of the errors raised here; the translator takes their text as it is


class Reason(NamedTuple):
    """Why a range ends where it ends; stands beside the range and is told with it."""

    text: str


class Broken(NamedTuple):
    """A rule between several keys that does not hold, told at one of them."""

    key: KeyPath  # within the model
    message: str
    value: object = None


class FileModel(BaseModel):
    """A frozen mapping of a configuration file.

    Unknown keys, text in place of numbers, NaN and infinity are refused; whole numbers become
    floats where a float is meant. Rules between keys are told all at once.
    """

    model_config = ConfigDict(
        frozen=True, strict=True, extra="forbid", allow_inf_nan=False, validate_default=True
    )

    foreign_keys: ClassVar[dict[str, str]] = {}
    """Keys that belong elsewhere, and what to say to somebody who writes them here."""

    inline: ClassVar[tuple[str, ...]] = ()
    """Keys of a file that may name another file with their mapping."""

    def broken_rules(self) -> Iterator[Broken]:
        """Rules between keys that do not hold; called when every key by itself is right."""
        yield from ()

    @model_validator(mode="after")
    def _rules(self) -> Self:
        broken = tuple(self.broken_rules())
        if broken:
            raise PydanticCustomError(RULE, "{text}", {"text": broken[0].message, "rules": broken})
        return self


def refuse(message: str, *key: str | int) -> PydanticCustomError:
    """The error a validator raises: ``message``, told at ``key`` below the validated value."""
    rules = (Broken(key, message),)
    return PydanticCustomError(RULE, "{text}", {"text": message, "rules": rules})


def _whole(value: Any) -> Any:
    # 1e3 is a float in YAML 1.2, and still a whole number to the person who wrote it.
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value


T = TypeVar("T")
Several = Annotated[tuple[T, ...], Field(strict=False)]
"""A list of the file, as a tuple."""

Whole = Annotated[int, BeforeValidator(_whole)]
"""A whole number, also when written as 1e3."""
