"""Execution of a source text as a module of its own, named by a hash."""

import hashlib
import linecache
import sys
from collections.abc import Callable, Mapping, Sequence
from types import ModuleType
from typing import Any


def execute(
    prefix: str, source: str, identity: Sequence[str], names: Callable[[str], Mapping[str, Any]]
) -> Any:
    """Return the module of a written source, named by a hash of it and of its ``identity``.

    ``names`` returns what the source uses, for the name of the module. The ``identity`` stands for
    the names: modules of equal hashes are the same one.
    """
    digest = hashlib.sha256("\0".join([source, *identity]).encode()).hexdigest()
    name = f"{prefix}_{digest[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    module = ModuleType(name)
    module.__file__ = f"<{name}>"
    vars(module).update(names(name))
    # `inspect.getsource` reads this text: a hash of it names the folder of compiled code.
    lines = source.splitlines(keepends=True)
    linecache.cache[module.__file__] = (len(source), None, lines, module.__file__)
    exec(compile(source, module.__file__, "exec", dont_inherit=True), vars(module))
    sys.modules[name] = module
    return module
