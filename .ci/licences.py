"""Check the licences of all dependencies: `python .ci/licences.py [DISTRIBUTION ...]`.

Prints the licence of every distribution that the named ones (default: wec-rig) need here, with the
extras that are installed, and ends with status 1 if one is not in the list below.
"""

import re
import sys
from importlib.metadata import Distribution, PackageNotFoundError, distribution

from packaging.requirements import Requirement

ALLOWED = re.compile(
    r"\b(MIT|MIT-CMU|0?BSD|BSD-[23]-Clause|Apache|Apache-2\.0|ISC|ISCL|PSF|PSF-2\.0|Zlib|CC0-1\.0|"
    r"MPL|MPL-2\.0|Python Software Foundation|LGPL-3\.0-only|any-OSI)\b"
)
REFUSED = re.compile(r"\bA?GPL\b|\bGNU (Affero )?General Public\b|\bproprietary\b", re.IGNORECASE)
# The wheel of pysoem (MIT) contains SOEM: GPL version 2 with an exception for linking. Therefore it
# is an extra, `ethercat`, and never a dependency (docs/ethercat.md).
OPTIONAL_GPL = {"pysoem": "MIT; contains SOEM, GPL-2.0 with linking exception; optional"}


def licence_of(found: Distribution) -> str:
    """Return the licence as the metadata give it: the SPDX expression, or classifiers."""
    metadata = found.metadata
    expression = metadata.get("License-Expression")
    classifiers = [
        text.rpartition(" :: ")[2]
        for text in metadata.get_all("Classifier") or []
        if text.startswith("License :: ")
    ]
    first_line = (metadata.get("License") or "").strip().partition("\n")[0]
    return str(expression or "; ".join(classifiers) or first_line or "not stated")


def needed(name: str, extras: set[str], found: dict[str, Distribution]) -> None:
    """Add a distribution that is installed, and all that it needs, to those found."""
    try:
        dist = distribution(name)
    except PackageNotFoundError:
        return  # of an extra, or of another platform
    key = re.sub(r"[-_.]+", "-", name).lower()
    if key in found:
        return
    found[key] = dist
    for text in dist.requires or ():
        requirement = Requirement(text)
        marker = requirement.marker
        contexts = [{"extra": extra} for extra in ("", *extras)]
        if marker is None or any(marker.evaluate(each) for each in contexts):
            needed(requirement.name, set(requirement.extras), found)


def main(names: list[str]) -> int:
    """Print name, version and licence of each; return the exit code."""
    found: dict[str, Distribution] = {}
    for name in names or ["wec-rig"]:
        extras = set(distribution(name).metadata.get_all("Provides-Extra") or ()) - {"dev", "bem"}
        needed(name, extras, found)
    refused = []
    for key, dist in sorted(found.items()):
        text = OPTIONAL_GPL.get(key) or licence_of(dist)
        allowed = key in OPTIONAL_GPL or (ALLOWED.search(text) and not REFUSED.search(text))
        refused += [] if allowed else [key]
        print(f"{'  ' if allowed else '!!'} {key:24} {dist.version:12} {text}")
    print(f"{len(found)} distributions, not allowed: {', '.join(refused) or 'none'}")
    return 1 if refused else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
