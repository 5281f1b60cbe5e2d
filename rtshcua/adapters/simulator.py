"""The simulated vehicle in a separate process, started for one run and ended with it."""

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Self

START_S = 20.0
_STOP_S = 2.0
_USAGE = 2  # its exit code for invalid options
_MODULE = "rtshcua.simulation"


class SimulatorError(Exception):
    """The simulated vehicle did not start; the text is for people. `usage`: its options are invalid."""

    def __init__(self, text: str, *, usage: bool = False) -> None:
        super().__init__(text)
        self.usage = usage


class Simulator:
    """Starts `python -m rtshcua.simulation` with these options, and waits until it is up. Its standard input is a pipe
    from this process, so it ends with this process in any case; it has its own session, so that Ctrl-C in the terminal
    does not reach it.

    `ready` is its first output. Raises `SimulatorError`.
    """

    def __init__(self, options: Sequence[str], patience_s: float = START_S) -> None:
        # -P: import nothing from the working folder
        command = [sys.executable, "-P", "-m", _MODULE, *options]
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
            )
        except OSError as error:
            raise SimulatorError(f"the simulated vehicle cannot be started: {error.strerror or error}") from error
        line = self._first_line(patience_s)
        if line is None:
            reason = self._reason()
            self.stop()
            usage = self._process.returncode == _USAGE
            raise SimulatorError(f"the simulated vehicle did not start: {reason}", usage=usage)
        self.ready: dict[str, Any] = json.loads(line)
        assert self._process.stdin is not None
        os.set_blocking(self._process.stdin.fileno(), False)

    def wait(self) -> int:
        """Wait until the process ends by itself; return its exit code."""
        return self._process.wait()

    def inject(self, fault: str) -> None:
        """Inject a fault, in the form of `--fault`, with its time counted from now. Raises `SimulatorError`."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(fault.encode("ascii") + b"\n")
            self._process.stdin.flush()
        except OSError as error:
            raise SimulatorError(f"the simulated vehicle ended: {error.strerror or error}") from error

    def heard(self, boot_us: int) -> None:
        """Report which of its positions was received last, by its time since boot: faster than real time, the
        simulation waits for us. Never waits.
        """
        assert self._process.stdin is not None
        with suppress(OSError, ValueError):  # it does not read at present, or has ended
            os.write(self._process.stdin.fileno(), b"heard %d\n" % boot_us)

    def stop(self) -> None:
        """End it by closing its input and, if it does not react, by signals."""
        process = self._process
        if process.stdin is not None:
            with suppress(OSError):
                process.stdin.close()
        for end in (process.terminate, process.kill):
            try:
                process.wait(_STOP_S)
                break
            except subprocess.TimeoutExpired:
                end()
        process.wait()
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _first_line(self, patience_s: float) -> bytes | None:
        """Its first output, a JSON object; None if nothing comes in time, or it ended."""
        assert self._process.stdout is not None
        handle, line = self._process.stdout.fileno(), b""
        end = time.monotonic() + patience_s
        while not line.endswith(b"\n"):
            left = end - time.monotonic()
            if left <= 0 or not select.select([handle], [], [], left)[0]:
                return None
            part = os.read(handle, 4_096)
            if not part:
                return None
            line += part
        return line

    def _reason(self) -> str:
        try:
            _, errors = self._process.communicate(timeout=_STOP_S)
        except subprocess.TimeoutExpired:
            return "it did not respond in time"
        lines = errors.decode("utf-8", "replace").strip().splitlines()
        last = lines[-1] if lines else f"it exited with code {self._process.returncode}"
        return last.partition("error: ")[2] or last
