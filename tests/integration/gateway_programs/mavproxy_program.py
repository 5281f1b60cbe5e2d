"""A MAVProxy console, typed at: `mavproxy_program.py ADDRESS ACTIONS`, as `mavsdk_program.py`. What it reads are the
lines of the console. It imports no code of the project.
"""

import json
import re
import subprocess
import sys
import sysconfig
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

LIMIT_S = 90.0


class Program:
    """One console, its lines, and the last values that it shows."""

    def __init__(self, address: str) -> None:
        self._folder = tempfile.TemporaryDirectory()
        script = str(Path(sysconfig.get_path("scripts")) / "mavproxy.py")
        options = [f"--master={address}", "--default-modules=arm,mode,misc,cmdlong,wp", "--no-state", "--streamrate=4"]
        self._process = subprocess.Popen(
            [sys.executable, script, *options, "--dialect=ardupilotmega"], cwd=self._folder.name, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        self.texts: list[str] = []
        self.position: tuple[int, int, int] | None = None
        self.armed = False
        threading.Thread(target=self._listen, daemon=True).start()
        self.until(lambda: any("Detected vehicle" in line for line in self.texts))
        self.type("watch GLOBAL_POSITION_INT HEARTBEAT")
        self.until(lambda: self.position is not None)

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if "GLOBAL_POSITION_INT {" in line:
                at = {name: int(value) for name, value in re.findall(r"(\w+) : (-?\d+)", line)}
                self.position = at["lat"], at["lon"], at["relative_alt"]
            elif "HEARTBEAT {" in line:
                found = re.search(r"base_mode : (\d+)", line)
                self.armed = found is not None and bool(int(found[1]) & 128)
            else:
                self.texts.append(line.rstrip())

    def type(self, words: str) -> None:
        """Type a line."""
        assert self._process.stdin is not None
        self._process.stdin.write(words + "\n")
        self._process.stdin.flush()

    def until(self, wanted: Callable[[], bool]) -> None:
        """Wait until the console shows it."""
        end_s = time.monotonic() + LIMIT_S
        while not wanted():
            assert time.monotonic() < end_s, self.texts
            time.sleep(0.1)

    def answered(self, command: str) -> bool:
        """Wait for the answer to a command; whether it was accepted."""
        answer = f"Got COMMAND_ACK: {command}: "
        self.until(lambda: any(answer in line and "IN_PROGRESS" not in line for line in self.texts))
        return any(f"{answer}ACCEPTED" in line for line in self.texts)

    def takeoff(self, height: float) -> bool:
        """Arm, take off, and wait for the height."""
        self.type("mode guided")
        self.type("arm throttle")
        if not self.answered("COMPONENT_ARM_DISARM"):
            return False
        self.type(f"takeoff {height}")
        if not self.answered("NAV_TAKEOFF"):
            return False
        self.until(lambda: self.position is not None and self.position[2] > (height - 1.5) * 1_000)
        return True

    def goto(self, latitude: float, longitude: float, height: float) -> bool:
        """Go to a place and wait for the arrival, or for a refusal."""
        self.type(f"guided {latitude} {longitude} {height}")

        def done() -> bool:
            if any("goto " in line and ("denied" in line or "rejected" in line) for line in self.texts):
                return True
            assert self.position is not None
            return abs(self.position[0] / 1e7 - latitude) < 4e-5 and abs(self.position[1] / 1e7 - longitude) < 6e-5

        self.until(done)
        return not any("goto " in line for line in self.texts)

    def land(self) -> bool:
        """Land and wait for the motors to stop."""
        self.type("mode land")
        self.until(lambda: self.position is not None and self.position[2] < 500 and not self.armed)
        return True

    def close(self) -> None:
        """End the console."""
        self._process.kill()
        self._process.wait()
        self._folder.cleanup()


def main() -> None:
    """Carry out the actions."""
    program = Program(sys.argv[1])
    try:
        for name, *values in json.loads(sys.argv[2]):
            program.texts.clear()
            succeeded = getattr(program, name)(*values)
            time.sleep(0.5)
            print(json.dumps({"action": name, "succeeded": succeeded, "reads": program.texts}), flush=True)
    finally:
        program.close()


if __name__ == "__main__":
    main()
