"""Execute scripts of a page in one namespace: one JSON object per line, one answer per script."""

import io
import json
import sys
import traceback
from contextlib import redirect_stdout


def main() -> None:
    """Answer each line {"source": ..., "line": ...} with {"output": ..., "error": ...}."""
    names: dict[str, object] = {"__name__": "__main__"}
    sys.path.insert(0, "")
    for request in map(json.loads, sys.stdin):
        output, error = io.StringIO(), ""
        try:
            with redirect_stdout(output):
                exec(compile(request["source"], f"block at line {request['line']}", "exec"), names)
        except BaseException:  # noqa: BLE001  whatever a page's script raises is the answer
            error = traceback.format_exc(limit=-3)
        print(json.dumps({"output": output.getvalue(), "error": error}), flush=True)


if __name__ == "__main__":
    main()
