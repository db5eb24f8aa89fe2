"""Commands to the emulator on its standard input; prints its answers and its exit code."""

from __future__ import annotations

import json
import subprocess
import sys

COMMANDS = (
    "inject torque_drive unplugged",
    "inject toaster unplugged",
    "report",
    "inject torque_drive gremlin",
    "make coffee",
    "faults",
    "inject link freeze",
)

if __name__ == "__main__":
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    command = [sys.executable, "-m", "sim_plant.emulators.ethercat", "lo"]
    command += ["--slaves", "coupler,torque_drive", *sys.argv[1:]]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        ready = json.loads(process.stdout.readline())
        process.stdin.write("".join(f"{each}\n" for each in COMMANDS))
        process.stdin.flush()
        answers = [json.loads(process.stdout.readline()) for _ in COMMANDS]
        process.terminate()
        code = process.wait(10.0)
    print(json.dumps({"ready": ready, "answers": answers, "code": code}))
