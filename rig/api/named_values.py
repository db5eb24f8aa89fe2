"""Values by name that are attributes, too."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Generic, TypeVar

T = TypeVar("T")


class NamedValues(Mapping[str, T], Generic[T]):
    """A mapping whose values are attributes, too: `values.name` is `values["name"]`."""

    @abstractmethod
    def __getitem__(self, name: str) -> T:
        """Return a value; KeyError with a message that lists the names."""

    def __getattr__(self, name: str) -> T:
        if name.startswith("_"):  # pickling and copying ask before there are values
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(name for name in self if name.isidentifier())]
