"""The process that chooses the rows of an adaptive campaign, beside its run."""

import subprocess
import sys
import threading
import time
from contextlib import closing, suppress
from pathlib import Path

from rig.module_process import module_command
from rig.people.orders import CAMPAIGN
from rig.people.request_client import RequestClient

ERRORS = "choosing.stderr"  # in the run's folder
_RETRY_S = 0.5


class ChoosingProcess:
    """Runs `rig.campaign.choosing` for a run; without it, the run finishes with the rows so far."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._folder = Path()
        self._closes = False
        self.problem = ""  # why rows are not chosen any more

    def begin(self, folder: Path) -> None:
        """Choose the rows of the run in a folder, which need not listen yet."""
        self._folder = folder
        with (folder / ERRORS).open("wb") as errors:
            self._process = subprocess.Popen(
                module_command("rig.campaign.choosing", str(folder)),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,  # Ctrl-C at the terminal is for the run
            )
        threading.Thread(target=self._watch, name="choosing", daemon=True).start()

    def close(self) -> None:
        """End the process; the run has ended."""
        self._closes = True
        if self._process is not None:
            self._process.terminate()
            self._process.wait()

    def _watch(self) -> None:
        assert self._process is not None
        code = self._process.wait()
        if code == 0 or self._closes:
            return
        lines = (self._folder / ERRORS).read_text(errors="replace").strip().splitlines()
        why = lines[-1] if lines else f"its process ended with code {code}"
        self.problem = f"no more rows are chosen: {why} ({self._folder / ERRORS})"
        print(f"{self.problem}; the run finishes", file=sys.stderr, flush=True)
        with (
            suppress(OSError),  # the run has ended meanwhile
            closing(RequestClient(self._folder, "", "adaptive campaign", CAMPAIGN)) as client,
        ):
            # Refused as long as the drive is not on yet.
            while not client.ask("finish", why=self.problem).get("accepted"):
                time.sleep(_RETRY_S)
