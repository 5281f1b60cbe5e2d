"""Run command lines in processes forked from one that has loaded the program and the shipped sources.

A fresh process loads modules for almost a second. Tests that do not test the start save that second.
"""

import atexit
import gc
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from struct import Struct
from tempfile import TemporaryFile
from threading import Thread
from typing import BinaryIO, NamedTuple

#: packages that commands import
LOADED = ("rtshcua.front.cli", "rtshcua.ground", "rtshcua.adapters.store", "rtshcua.front.mcp")


class Ended(NamedTuple):
    """The result of a command."""

    code: int
    out: str
    err: str


#: replies about a command: its process id, then its return code as in `subprocess`; requests begin with their length
#: and
#: the descriptors of input and both outputs
TOLD = Struct("=i")


class Started:
    """A running command, with the parts of `subprocess.Popen` that tests use."""

    def __init__(self, told: socket.socket, out: BinaryIO, err: BinaryIO) -> None:
        self._told, self.stdout, self.stderr = told, out, err
        self.pid = self._next()
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return the exit code, or None while it runs."""
        with suppress(TimeoutError):
            self.wait(0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the exit code, negative for a signal. Raise TimeoutError."""
        if self.returncode is None:
            self._told.settimeout(timeout)
            try:
                self.returncode = self._next()
            except BlockingIOError:  # the reply without waiting
                raise TimeoutError from None
            self._told.close()
        return self.returncode

    def send_signal(self, number: signal.Signals) -> None:
        """Send a signal if it still runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """Terminate it."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """Kill it."""
        self.send_signal(signal.SIGKILL)

    def communicate(self) -> tuple[bytes, bytes]:
        """Wait for its end and return the remaining output of both streams."""
        said: list[bytes] = []
        aside = Thread(target=lambda: said.append(_rest(self.stderr)))
        aside.start()
        out = _rest(self.stdout)
        aside.join()
        self.wait()
        return out, said[0]

    def _next(self) -> int:
        octets = self._told.recv(TOLD.size)
        assert octets, "whoever waited for it is gone"
        (number,) = TOLD.unpack(octets)
        return int(number)


def _rest(stream: BinaryIO) -> bytes:
    """Read the rest of a stream and close it; return nothing if it is closed."""
    if stream.closed:
        return b""
    with stream:
        return stream.read()


class Forked:
    """The process with the loaded program, reached by a socket and shared by all test processes."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def run(self, words: Sequence[str], folder: Path, patience_s: float) -> Ended:
        """Run `rtshcua` with these arguments in a folder, with the current environment. Raise TimeoutError."""
        with TemporaryFile() as out, TemporaryFile() as err:
            command = Started(self._asked(words, folder, os.environ, out.fileno(), err.fileno()), out, err)
            try:
                code = command.wait(patience_s)
            except TimeoutError:
                command.kill()
                command.wait()
                raise TimeoutError(f"{patience_s} s were not enough for {words}") from None
            for file in (out, err):
                file.seek(0)
            return Ended(code, out.read().decode(), err.read().decode())

    def start(self, words: Sequence[str], folder: Path, environment: Mapping[str, str]) -> Started:
        """Start `rtshcua` with these arguments in a folder and an environment, with empty input."""
        (out, told_out), (err, told_err) = os.pipe(), os.pipe()
        try:
            told = self._asked(words, folder, environment, told_out, told_err)
        finally:
            os.close(told_out)
            os.close(told_err)
        return Started(told, os.fdopen(out, "rb"), os.fdopen(err, "rb"))

    def program(self, file: Path) -> str:
        """Write an executable that behaves like `rtshcua` but starts at once."""
        file.write_text(PROGRAM.format(python=sys.executable, path=str(self._path)), encoding="utf-8")
        file.chmod(0o755)
        return str(file)

    def _asked(
        self, words: Sequence[str], folder: Path, environment: Mapping[str, str], out: int, err: int
    ) -> socket.socket:
        channel = socket.socket(socket.AF_UNIX)
        channel.connect(str(self._path))
        asked = json.dumps([list(words), str(folder), dict(environment)]).encode()
        with Path(os.devnull).open("rb") as nothing:
            socket.send_fds(channel, [TOLD.pack(len(asked))], [nothing.fileno(), out, err])
        channel.sendall(asked)
        return channel


#: isolated and without site packages: starts in a hundredth of the command's load time
PROGRAM = """#!{python} -IS
import json, os, signal, socket, struct, sys
channel = socket.socket(socket.AF_UNIX)
channel.connect({path!r})
asked = json.dumps([sys.argv[1:], os.getcwd(), dict(os.environ)]).encode()
socket.send_fds(channel, [struct.pack("=i", len(asked))], [0, 1, 2])
channel.sendall(asked)
process, = struct.unpack("=i", channel.recv(4))
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, lambda number, frame: os.kill(process, number))
code, = struct.unpack("=i", channel.recv(4))
os._exit(code if code >= 0 else 128 - code)
"""


@contextmanager
def forked(path: Path) -> Iterator[None]:
    """Run such a process; clients of the path wait until it has loaded."""
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))
        listening.listen(100)
        process = subprocess.Popen(
            [sys.executable, __file__, str(listening.fileno())], stdin=subprocess.PIPE, start_new_session=True,
            pass_fds=[listening.fileno()],
        )  # fmt: skip
    with process:
        try:
            yield
        finally:
            process.kill()


def _serve(listening: socket.socket) -> None:
    """Start each requested command and report its end, until the input ends."""
    for package in map(import_module, LOADED):
        for each in walk_packages(package.__path__, f"{package.__name__}."):
            if not each.name.endswith("__main__"):
                import_module(each.name)
    _warm()
    gc.collect()
    gc.freeze()  # garbage collection would write to all objects, and copy their pages for each command
    woken, wake = socket.socketpair()
    wake.setblocking(False)
    signal.set_wakeup_fd(wake.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    under_way: dict[int, socket.socket] = {}
    while True:
        ready, _, _ = select.select([0, listening, woken], [], [])
        if 0 in ready:
            return
        if woken in ready:
            woken.recv(4_096)
            _tell(under_way)
        if listening in ready:
            channel, _ = listening.accept()
            asked, given = _received(channel)
            words, folder, environment = json.loads(asked)
            command = os.fork()
            if command == 0:
                for each in (listening, woken, wake, channel, *under_way.values()):
                    each.close()
                _command(words, folder, environment, given)
            for each in given:
                os.close(each)
            under_way[command] = channel
            with suppress(BrokenPipeError):
                channel.sendall(TOLD.pack(command))


def _received(channel: socket.socket) -> tuple[bytes, list[int]]:
    """Receive a request and its descriptors."""
    octets, given, _, _ = socket.recv_fds(channel, TOLD.size, 3)
    (length,) = TOLD.unpack(octets)
    asked = b""
    while len(asked) < length:
        asked += channel.recv(length - len(asked))
    return asked, given


def _tell(under_way: dict[int, socket.socket]) -> None:
    """Report ended commands."""
    with suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            with suppress(BrokenPipeError), under_way.pop(ended[0]) as channel:  # the client may be gone
                channel.sendall(TOLD.pack(os.waitstatus_to_exitcode(ended[1])))


def _command(words: Sequence[str], folder: str, environment: Mapping[str, str], given: Sequence[int]) -> None:
    """Become the command: take over input, outputs, folder and environment, run, and exit."""
    code = 1
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for descriptor, each in enumerate(given):
            os.dup2(each, descriptor)
            os.close(each)
        # inherited streams may be files with a position
        sys.stdin = os.fdopen(0, "r", closefd=False)
        sys.stdout = os.fdopen(1, "w", buffering=1 if os.isatty(1) else -1, closefd=False)
        sys.stderr = os.fdopen(2, "w", buffering=1, errors="backslashreplace", closefd=False)
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        time.tzset()
        code = _main(words)
        # Python's shutdown without unloading modules
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        _flush()
    finally:
        os._exit(code)


def _warm() -> None:
    """Load the shipped sources as each command would: read, checked, zones compared."""
    from rtshcua import library
    from rtshcua.app.programs import compile_sources

    compile_sources([library.root() / "missions" / "standard.rts"], mission=None, issued_at_us=0)


def _main(words: Sequence[str]) -> int:
    from rtshcua.front.cli.app import main

    try:
        return main(words)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 1
    except Exception:  # noqa: BLE001  told as Python would tell it
        traceback.print_exc()
        return 1
    finally:
        _flush()


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        stream.flush()


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))
