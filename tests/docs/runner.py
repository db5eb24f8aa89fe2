"""Run the blocks of a page in order, in a folder of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from .blocks import RUN, Block, Command, blocks, commands
from .output import difference, last_states, matches
from .page_files import ROOT
from .pictures import pictures, source_of

TIMEOUT_S = 1200.0  # of a command; a busy host runs a campaign a tenth as fast
_STATE = ".page_state"  # of the shell: folder and exit code after a command


Worker = subprocess.Popen[str]


class Finding(NamedTuple):
    """A difference between a page and the program."""

    line: int
    text: str


class Shown(NamedTuple):
    """The real output of a command or script, and the place of its shown output in the page."""

    first: int  # index of the first shown line, from 0
    last: int  # index behind the last one
    indent: str
    real: list[str]
    is_same: bool


class PageRun:
    """A page that runs in a folder; `findings` lists the differences."""

    def __init__(self, text: str, folder: Path, timeout_s: float = TIMEOUT_S) -> None:
        self.blocks, self.folder = blocks(text), folder
        self._pictures = pictures(text)
        self.timeout_s = timeout_s
        self.findings: list[Finding] = []
        self.shown: list[Shown] = []
        self._background: list[subprocess.Popen[bytes]] = []
        self._code = 0
        self._where = folder

    def run(self) -> list[Finding]:
        """Run all blocks and return the findings."""
        worker = [sys.executable, str(ROOT / "tests" / "docs" / "python_worker.py")]
        with subprocess.Popen(
            worker, cwd=self.folder, env=environment(), text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        ) as python:  # fmt: skip
            try:
                for number, block in enumerate(self.blocks):
                    self._run_block(block, self.blocks[number + 1 : number + 2], python)
            finally:
                for process in self._background:
                    os.killpg(process.pid, signal.SIGINT)
                    process.wait(60)
        for picture in self._pictures:
            if source_of(picture, self.folder) is None:
                text = f"no command of the page writes {picture.source}"
                self.findings.append(Finding(picture.line, text))
        return self.findings

    def _run_block(self, block: Block, following: list[Block], python: Worker) -> None:
        if block.not_run or block.language not in RUN:
            return
        if block.title:
            self._write(block)
        elif block.language == "python":
            self._run_script(block, following, python)
        elif block.language == "console":
            for command in commands(block):
                self._run_command(block, command)
        else:
            text = f'a {block.language} block names its file: ```{block.language} title="NAME"'
            self.findings.append(Finding(block.line, text))

    def _write(self, block: Block) -> None:
        path = self._where / block.title
        path.parent.mkdir(parents=True, exist_ok=True)
        if block.is_added and not path.exists():
            self.findings.append(Finding(block.line, f"no earlier block writes {block.title}"))
            return
        earlier = path.read_text() if block.is_added else ""
        path.write_text(earlier + block.text)
        if block.language == "yaml" and _is_task(path.read_text()):
            done = subprocess.run(
                [sys.executable, "-m", "rig", "check", str(path)],
                cwd=self._where, env=environment(), capture_output=True, text=True, check=False,
            )  # fmt: skip
            if done.returncode:
                text = f"`rig check {block.title}` refuses it:\n{done.stdout}{done.stderr}"
                self.findings.append(Finding(block.line, text))

    def _run_script(self, block: Block, following: list[Block], python: Worker) -> None:
        assert python.stdin
        assert python.stdout
        python.stdin.write(json.dumps({"source": block.text, "line": block.line}) + "\n")
        python.stdin.flush()
        answer = json.loads(python.stdout.readline())
        if answer["error"]:
            self.findings.append(Finding(block.line, answer["error"]))
        after = following[0] if following else None
        if after and after.language == "text" and after.title == "output":
            self._compare(after.body, last_states(answer["output"]), after.line, after.indent)

    def _run_command(self, block: Block, command: Command) -> None:
        if command.text.endswith(" &"):
            self._start(command.text.removesuffix(" &"))
            return
        state = self.folder / _STATE
        at_end = f"trap 'code=$?; echo $code >{state}; pwd >>{state}' EXIT"
        script = f"{at_end}\n(exit {self._code})\n{command.text}"
        process = subprocess.Popen(
            ["bash", "-c", script], cwd=self._where, env=environment(), process_group=0,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        try:
            output, _ = process.communicate(timeout=self.timeout_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # bash, and all programs that it has started
            process.communicate()
            self.findings.append(Finding(command.line, f"no end within {self.timeout_s:g} s"))
            return
        real = last_states(output.decode())
        real = [line.replace(str(self.folder), "/home/you/rig") for line in real]
        code, where = state.read_text().split()
        state.unlink()
        self._where = Path(where)
        last = command is commands(block)[-1] or not self._checks_code(block, command)
        self._code = int(code)
        if self._code and last:
            text = f"`{command.text}` exits with {code}:\n" + "\n".join(real[-30:])
            self.findings.append(Finding(command.line, text))
        if command.shown:
            shown_at = command.line + command.text.count("\n")
            self._compare(command.shown, real, shown_at, block.indent)

    @staticmethod
    def _checks_code(block: Block, command: Command) -> bool:
        """Return whether the next command prints the exit code of this one."""
        following = [each.text for each in commands(block) if each.line > command.line]
        return bool(following) and "$?" in following[0]

    def _start(self, text: str) -> None:
        with (self.folder / f".background_{len(self._background)}").open("wb") as log:
            process = subprocess.Popen(
                # Ctrl-C must end it, also where a shell in the background has started the tests.
                ["env", "--default-signal=INT", "bash", "-c", text],
                cwd=self._where, env=environment(), process_group=0,
                stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
            )  # fmt: skip
        self._background.append(process)

    def _compare(self, shown: list[str], real: list[str], line: int, indent: str) -> None:
        is_same = matches(shown, real)
        self.shown.append(Shown(line, line + len(shown), indent, real, is_same))
        if not is_same:
            text = f"output differs:\n{difference(shown, real)}"
            self.findings.append(Finding(line, text))


def environment() -> dict[str, str]:
    """Return the environment of a page's commands: `rig` and `python` are those of the tests."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST")}
    return kept | {
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "COLUMNS": "100",
        "NO_COLOR": "1",
        "TERM": "dumb",
        "MPLBACKEND": "agg",
    }


def _is_task(text: str) -> bool:
    """Return whether a file is a campaign or session, which `rig check` reads."""
    keys = {line.partition(":")[0] for line in text.splitlines() if line[:1].isalpha()}
    return {"name", "rig"} <= keys
