"""Command lines in processes of their own, each forked from one that has loaded the command and read what ships.

A process that starts afresh loads modules for most of a second before it reads its first word. Where it is the command
that is looked at, and not how it starts, this saves that second each time.
"""

import atexit
import gc
import json
import os
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
from threading import Lock, Thread, Timer
from typing import BinaryIO, NamedTuple

#: the packages of what commands load sooner or later
LOADED = ("rtshcua.cli", "rtshcua.ground", "rtshcua.adapters.files")


class Ended(NamedTuple):
    """What a command came to."""

    code: int
    out: str
    err: str


#: what is told of a command that goes on: first its process id, then how it ended, as `subprocess` tells it
TOLD = Struct("=i")


class Started:
    """A command under way: what tests use of `subprocess.Popen`, with pipes for both outputs."""

    def __init__(self, told: socket.socket, out: int, err: int) -> None:
        self._told = told
        self.stdout, self.stderr = open(out, "rb"), open(err, "rb")  # noqa: SIM115  descriptors, for as long as this
        self.pid = self._next()
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """The exit code, or None while it runs."""
        with suppress(TimeoutError):
            self.wait(0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """The exit code, negative for the signal that ended it. Raises TimeoutError."""
        if self.returncode is None:
            self._told.settimeout(timeout)
            try:
                self.returncode = self._next()
            except BlockingIOError:  # as it is told where nothing is waited for
                raise TimeoutError from None
            self._told.close()
        return self.returncode

    def send_signal(self, number: signal.Signals) -> None:
        """A signal, if it runs still."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)

    def communicate(self) -> tuple[bytes, bytes]:
        """What it says from now on, on both outputs, once it has ended."""
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
    """What is left to read of a stream, which is closed then; nothing of one that is."""
    if stream.closed:
        return b""
    with stream:
        return stream.read()


class Forked:
    """The process that has loaded the commands. Whoever waits too long for one ends with all of them."""

    def __init__(self, process: "subprocess.Popen[str]", channel: socket.socket) -> None:
        self._process, self._channel = process, channel
        self._one_at_a_time = Lock()

    def run(self, words: Sequence[str], folder: Path, patience_s: float) -> Ended:
        """`rtshcua` with these words in a folder, under the environment of now. Raises TimeoutError."""
        with self._one_at_a_time:
            self._ask(words, folder, os.environ, wait=True)
            late = Timer(patience_s, self._process.kill)
            late.start()
            try:
                assert self._process.stdout is not None
                answer = self._process.stdout.readline()
            finally:
                late.cancel()
        if not answer:
            raise TimeoutError(f"{patience_s} s were not enough for {words}")
        return Ended(*json.loads(answer))

    def start(self, words: Sequence[str], folder: Path, environment: Mapping[str, str]) -> Started:
        """`rtshcua` with these words in a folder and an environment, under way, with nothing to read."""
        own, other = socket.socketpair()
        (out, told_out), (err, told_err) = os.pipe(), os.pipe()
        with self._one_at_a_time:
            self._ask(words, folder, environment, wait=False)
            socket.send_fds(self._channel, [b"."], [told_out, told_err, other.fileno()])
        os.close(told_out)
        os.close(told_err)
        other.close()
        return Started(own, out, err)

    def _ask(self, words: Sequence[str], folder: Path, environment: Mapping[str, str], *, wait: bool) -> None:
        given = self._process.stdin
        assert given is not None
        print(json.dumps([list(words), str(folder), dict(environment), wait]), file=given, flush=True)


@contextmanager
def forked() -> Iterator[Forked]:
    """Such a process, as long as it is wanted."""
    own, other = socket.socketpair()
    command = [sys.executable, __file__, str(other.fileno())]
    with own, other, subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True,
        pass_fds=[other.fileno()],
    ) as process:  # fmt: skip
        other.close()
        try:
            yield Forked(process, own)
        finally:
            process.kill()


def _serve(channel: socket.socket) -> None:
    """Read one command line after the other, and say what each came to."""
    for package in map(import_module, LOADED):
        for each in walk_packages(package.__path__, f"{package.__name__}."):
            if not each.name.endswith("__main__"):
                import_module(each.name)
    _warm()
    gc.collect()
    gc.freeze()  # what is looked at is written to, and copied for each command
    for line in sys.stdin:
        words, folder, environment, wait = json.loads(line)
        with suppress(ChildProcessError):  # those who waited for commands that are over
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        if not wait:
            _start(channel, words, folder, environment)
            continue
        with TemporaryFile() as out, TemporaryFile() as err:
            child = os.fork()
            if child == 0:
                _become(out.fileno(), err.fileno(), folder, environment)
                os._exit(_main(words))
            _, status = os.waitpid(child, 0)
            told = [os.waitstatus_to_exitcode(status)]
            for file in (out, err):
                file.seek(0)
                told.append(file.read().decode())
        print(json.dumps(told), flush=True)


def _start(channel: socket.socket, words: Sequence[str], folder: str, environment: Mapping[str, str]) -> None:
    """Begin a command, and have another process wait for it, which tells how it ended."""
    _, (out, err, told), _, _ = socket.recv_fds(channel, 1, 3)
    if os.fork() == 0:
        command = os.fork()
        if command == 0:
            _become(out, err, folder, environment)
            for each in (out, err, told, channel.detach()):
                os.close(each)
            code = _main(words)
            # what Python does at the end of a process, but for letting go of what is loaded
            threading._shutdown()  # type: ignore[attr-defined]
            atexit._run_exitfuncs()
            _flush()
            os._exit(code)
        os.close(out)
        os.close(err)
        os.write(told, TOLD.pack(command))
        _, status = os.waitpid(command, 0)
        with suppress(BrokenPipeError):  # nobody wants to know
            os.write(told, TOLD.pack(os.waitstatus_to_exitcode(status)))
        os._exit(0)
    for each in (out, err, told):
        os.close(each)


def _become(out: int, err: int, folder: str, environment: Mapping[str, str]) -> None:
    """Take over outputs, folder and environment."""
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(out, 1)
    os.dup2(err, 2)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    time.tzset()


def _warm() -> None:
    """Remember what ships as each command would: read, checked, its zones compared."""
    from rtshcua import library
    from rtshcua.cli.sources import compile_sources

    compile_sources([library.root() / "missions" / "standard.rts"], mission=None, issued_at_us=0)


def _main(words: Sequence[str]) -> int:
    from rtshcua.cli.app import main

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
