"""The example of docs/reference/ethercat.md as it is printed: shell lines, then the master."""

from __future__ import annotations

import contextlib
import io
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "ethercat.md"

if __name__ == "__main__":
    text = PAGE.read_text()
    blocks = dict(re.findall(r"```(sh|python)\n(.*?)```", text, re.DOTALL))
    *setup, start = blocks["sh"].strip().splitlines()
    for line in setup:
        subprocess.run(shlex.split(line), check=True)
    program, *arguments = shlex.split(start)
    assert program == "python"
    with subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        printed = io.StringIO()
        try:
            with contextlib.redirect_stdout(printed):
                exec(blocks["python"], {})
        finally:
            process.terminate()
    expected = re.search(r"It prints\n\n```\n(.*?)```", text, re.DOTALL)
    assert expected is not None
    print(json.dumps({"printed": printed.getvalue(), "expected": expected[1]}))
