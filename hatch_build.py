"""Build hook: adds to a wheel what its top-level folders lack.

- `rig/source.json`: the git commit from which the wheel or sdist was built, read by
  `rig.recording.provenance`. A wheel built from an sdist has no git checkout; it gets the file of
  the sdist.
- `rig/constraints.txt`: the tested versions of the libraries, read by `rig doctor`.

An editable installation gets neither: it runs the source tree.
"""

import json
import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class AddedFiles(BuildHookInterface):  # type: ignore[type-arg]
    """Adds the files; hatchling finds the class by its base class."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Write `source.json` to a temporary file, and include both files."""
        self._temporary = Path(self.directory, ".source.json")
        if version == "editable":
            return
        if self.target_name == "wheel":
            constraints = Path(self.root, "constraints.txt")
            build_data["force_include"][str(constraints)] = "rig/constraints.txt"
        commit = self._git("rev-parse", "HEAD") if Path(self.root, ".git").exists() else ""
        if commit:
            changed = self._git("status", "--porcelain", "--untracked-files=no")
            source = {"git": commit, "dirty": bool(changed)}
            self._temporary.parent.mkdir(parents=True, exist_ok=True)
            self._temporary.write_text(json.dumps(source) + "\n", encoding="utf-8")
            build_data["force_include"][str(self._temporary)] = "rig/source.json"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the temporary file."""
        self._temporary.unlink(missing_ok=True)

    def _git(self, *arguments: str) -> str:
        """Return the output of a git command; empty if it fails or git is missing."""
        command = ["git", "-C", self.root, *arguments]
        try:
            completed = subprocess.run(command, capture_output=True, text=True, check=True)
        except (OSError, subprocess.SubprocessError):
            return ""
        return completed.stdout.strip()
