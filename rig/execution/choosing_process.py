"""The process that chooses the rows of an adaptive campaign, beside its run."""

import subprocess
import sys
import threading
import time
from contextlib import closing, suppress
from pathlib import Path

from rig.module_process import module_command
from rig.people.orders import CAMPAIGN, awaits_choice
from rig.people.request_client import RequestClient
from rig.realtime.safety import RUN

ERRORS = "choosing.stderr"  # in the run's folder
# One choice among the most candidates takes about 20 s, and 60 s after a thousand rows.
TIMEOUT_S = 300.0  # s for one choice; then the process hangs
_LOOK_S = 0.5


class ChoosingProcess:
    """Runs `rig.campaign.choosing` for a run; without it, the run finishes with the rows so far."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._folder = Path()
        self._closes = False
        self.problem = ""  # why rows were not chosen any more, and the run finished

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
        thread = threading.Thread(
            target=self._watch, args=(self._process,), name="choosing", daemon=True
        )
        thread.start()

    def close(self) -> None:
        """End the process; the run has ended."""
        self._closes = True
        if self._process is not None:
            self._process.kill()  # also one that is stopped
            self._process.wait()

    def _watch(self, process: subprocess.Popen[bytes]) -> None:
        while not self._closes:
            with (
                suppress(OSError),  # the run does not listen yet, or not any more
                closing(RequestClient(self._folder, "", "adaptive campaign", CAMPAIGN)) as client,
            ):
                late = _wait_for_end(process, client)
                if process.returncode == 0:
                    return
                self._finish(client, late or _why_ended(process, self._folder / ERRORS))
                return
            time.sleep(_LOOK_S)

    def _finish(self, client: RequestClient, why: str) -> None:
        """Finish the run once the drive is on and nobody holds it; OSError when it has ended."""
        problem = f"no more rows are chosen: {why}"
        while True:
            row = client.ask("state").get("row")
            powered = row and row["safety.mode"] == RUN and not row["plan.live"]
            if powered and client.ask("finish", why=problem).get("accepted"):
                break
            time.sleep(_LOOK_S)
        self.problem = problem
        print(f"{problem}; the run finishes", file=sys.stderr, flush=True)


def _wait_for_end(process: subprocess.Popen[bytes], client: RequestClient) -> str:
    """Wait for the end of the process; return why it was killed, empty if it was not."""
    order, since = -1, time.monotonic()
    while process.poll() is None:
        state = client.ask("state")
        row, newest = state.get("row"), int(state["request"]["jump"])
        if not (row and awaits_choice(row)) or newest != order:
            order, since = newest, time.monotonic()
        elif time.monotonic() - since > TIMEOUT_S:
            process.kill()
            process.wait()
            return f"the choice took more than {TIMEOUT_S:g} s"
        time.sleep(_LOOK_S)
    return ""


def _why_ended(process: subprocess.Popen[bytes], errors: Path) -> str:
    try:
        lines = errors.read_text(errors="replace").strip().splitlines()
    except OSError:
        lines = []
    return f"{lines[-1]} ({errors})" if lines else f"its process ended with {process.returncode}"
