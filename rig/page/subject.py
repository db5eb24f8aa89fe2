"""The run that the page shows: one that runs, with its socket, or a recorded one."""

import json
import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from rig.page import contents
from rig.page.checklist import Checklist, Item
from rig.page.recorded import RecordedTap
from rig.page.streams import Foxglove, PlotJuggler
from rig.page.tap import RingTap, Tap
from rig.page.watch import RowPower, Watch
from rig.people.request_client import RequestClient, RequestError
from rig.presentation.phrases import mode_stamp
from rig.recording.journal import JOURNAL, Entry, read_journal
from rig.recording.row_layout import RowSchema
from rig.recording.runs import RunError, run_info
from rig.recording.runs.folder import CONFIG, STATUS, recorded_reasons
from rig.recording.runs.reader import blocks, open_files
from rig.regular_file import MAX_TABLE_BYTES, open_regular, read_regular

PRODUCTS = {".png": "image/png", ".pdf": "application/pdf", ".csv": "text/csv"}
STATE_INTERVAL_S = 0.2
_FIRST_ROWS = ("plan.row", "power.samples", "safety.mode")


class Subject:
    """A run for the page; `close` it at the end."""

    def __init__(
        self, folder: Path, tap: Tap, schema: RowSchema, facts: dict[str, Any], *, live: bool,
        loop_core: int | None = None,
    ) -> None:  # fmt: skip
        self.folder, self.tap, self.live = folder, tap, live
        self._schema = schema
        info = None if live else run_info(folder)
        self._config = info.config if info else _json(folder / CONFIG)
        self._plan = info.plan if info else _json(folder / "plan.json")
        self.watch = Watch(
            tap, self._config, self._plan, recorded_reasons(self._plan), facts.get("segments")
        )
        rig = self._config.get("rig")
        self.title = {
            "run": folder.name,
            "mode": facts["mode"],
            "stamp": mode_stamp(facts["mode"]),
            "rig": str(rig.get("name", "")) if isinstance(rig, dict) else "",
            "live": live,
        }
        intervals = self.watch.new_intervals()
        self._contents = contents.describe(tap.leaves, self._config, self._plan) | {
            "title": self.title,
            "budget": intervals.budget_name if intervals else "",
        }
        self._privileges: dict[str, Any] = {}  # as the loop reports them, soon after its start
        self.checklist = Checklist(facts["mode"], self._config, folder.parent, loop_core)
        self.columns: list[dict[str, Any]] = []  # of set points that people may choose
        self.orders: dict[str, Any] = {}  # their newest state
        self._earlier: dict[int, RowPower] = {}  # of rows before the page began; set as a whole
        self._closed = threading.Event()
        self._journal_size = 0
        self.journal: list[dict[str, Any]] = []
        if live:
            threading.Thread(target=self._ask_states, name="states", daemon=True).start()
            threading.Thread(target=self._read_earlier_rows, name="rows", daemon=True).start()

    def close(self) -> None:
        """Ask the run no more."""
        self._closed.set()
        self.checklist.close()
        for stream in self.watch.streams:
            stream.close()

    def stream_to(self, plotjuggler: str, rate_hz: float, foxglove: int | None) -> dict[str, str]:
        """Open the live streams that are given and return their addresses.

        ``plotjuggler``: HOST:PORT, with ``rate_hz`` rows a second; ``foxglove``: port. StreamError
        if one cannot be opened.
        """
        streams, addresses = self.watch.streams, {}
        if plotjuggler:
            streams.append(PlotJuggler(plotjuggler, self.tap.leaves, rate_hz, self.watch.dt))
            addresses["plotjuggler"] = f"udp://{plotjuggler}"
        if foxglove is not None:
            server = Foxglove(foxglove, self._schema, self.tap.start_utc_ns)
            streams.append(server)
            addresses["foxglove"] = f"ws://127.0.0.1:{server.port}"
        return addresses

    @property
    def speed(self) -> RecordedTap | None:
        """The replay, whose speed can be set; None of a run that runs."""
        return self.tap if isinstance(self.tap, RecordedTap) else None

    def describe(self) -> dict[str, Any]:
        """Return the contents of the page; all but the set points' columns stay as they are."""
        return self._contents | {"columns_live": self.columns}

    def checklist_items(self, orders: Mapping[str, Any]) -> list[Item]:
        """Return the checklist of a run that by its orders waits for arming; empty for others."""
        if not (self.live and orders.get("must_arm")):
            return []
        self._privileges = self._privileges or _json(self.folder / "privileges.json")
        return self.checklist.items(self.watch.conditions(self._privileges))

    def state(self) -> dict[str, Any]:
        """Return the state of run and orders for the page; with the power on no checks run."""
        if self.watch.powered:
            self.checklist.stop_checks("the power came on")
        status = _json(self.folder / STATUS)
        keys = ("status", "reason", "reason_text", "record", "ended_utc")
        return self.watch.state() | {
            "orders": self.orders,
            "end": {key: str(status.get(key, "")) for key in keys},
            "rows": {str(row): each for row, each in self.row_powers().items()},
            "products": self.products(),
            "checklist": [each._asdict() for each in self.checklist_items(self.orders)],
        }

    def row_powers(self) -> dict[int, RowPower]:
        """Return the powers of the rows, before and since the page began.

        Of a row that ended when the page began, the ring may have had the last ticks only.
        """
        found = self._earlier | self.watch.powers
        ended = (each for each in self._earlier.items() if found[each[0]].means == each[1].means)
        return found | dict(ended)

    def products(self) -> list[str]:
        """Return the names of pictures and tables in the run's folder."""
        with suppress(OSError):
            return sorted(
                each.name
                for each in self.folder.iterdir()
                if each.suffix in PRODUCTS and each.is_file() and not each.is_symlink()
            )
        return []

    def product(self, name: str) -> tuple[bytes, str] | None:
        """Return contents and type of a product; None if there is none of that name."""
        if name not in self.products():
            return None
        with suppress(OSError):
            path = self.folder / name
            return path.read_bytes(), PRODUCTS[path.suffix]
        return None

    def new_entries(self) -> list[dict[str, Any]]:
        """Return the entries that came into the journal since the last call."""
        path = self.folder / JOURNAL
        try:
            if path.stat().st_size == self._journal_size:
                return []
            with open_regular(path) as file:
                file.seek(self._journal_size)
                data = file.read(MAX_TABLE_BYTES)
        except OSError:
            return []
        whole = data[: data.rfind(b"\n") + 1]
        entries = list(read_journal(whole))
        self._journal_size += len(whole)
        self.watch.alarms.acknowledge(entries)
        self.checklist.take(entries)
        found = [_entry(each) for each in entries]
        self.journal = (self.journal + found)[-500:]
        return found

    def _ask_states(self) -> None:
        """Ask the run for its state, some times a second, until it ends."""
        client: RequestClient | None = None
        while not self._closed.wait(STATE_INTERVAL_S):
            try:
                if client is None:
                    client = RequestClient(self.folder, origin="page")
                    self.columns = client.ask("columns").get("columns", [])
                self.orders = client.ask("state")
            except RequestError:
                self.orders = {}
                if client is not None:
                    client.close()
                client = None
        if client is not None:
            client.close()

    def _read_earlier_rows(self) -> None:
        """Read the powers of rows that ended before the page began, from the file of the run."""
        names = [leaf.name for leaf in self.tap.leaves]
        intervals = self.watch.new_intervals()
        fields = {name for name in names if name.startswith("power.mean_")} | {*_FIRST_ROWS}
        fields |= {*(intervals.fields if intervals else ())}
        earlier: dict[int, RowPower] = {}
        with suppress(OSError, RunError, ValueError, KeyError):
            for block in blocks(open_files(self.folder), fields=sorted(fields)):
                rows = np.zeros((len(block), len(names)))
                for name in fields:
                    rows[:, names.index(name)] = block[name]
                earlier |= self.watch.powers_in(rows, intervals)
                if self._closed.is_set():
                    return
        self._earlier = earlier  # the server's thread may be reading the rows now


def attach(folder: Path, loop_core: int | None = None) -> Subject:
    """Return the run that runs in a folder; RequestError or ValueError if that is impossible.

    ``loop_core``: for the checks of the host; None: as a new process finds it.
    """
    client = RequestClient(folder, origin="page")
    try:
        facts, descriptor = client.hello()
    finally:
        client.close()
    schema = RowSchema(*facts["schema"])
    tap = RingTap(descriptor, schema.leaves, float(facts["dt"]))
    return Subject(folder, tap, schema, facts, live=True, loop_core=loop_core)


def replay(run: Path) -> Subject:
    """Return a recorded run; RunError if it cannot be read."""
    info = run_info(run)
    folder = run if run.is_dir() else run.parent
    tap = RecordedTap(run)
    return Subject(folder, tap, tap.schema, {"mode": info.mode}, live=False)


def _entry(entry: Entry) -> dict[str, Any]:
    return {
        key: value
        for key, value in entry._asdict().items()
        if key in ("utc", "tick", "person", "origin", "request", "accepted", "reason", "arguments")
    }


def _json(path: Path) -> dict[str, Any]:
    """Return a small JSON file of the run; empty if it is not there."""
    try:
        value = json.loads(read_regular(path, MAX_TABLE_BYTES))
    except (OSError, ValueError):
        return {}
    return value if isinstance(value, dict) else {}
