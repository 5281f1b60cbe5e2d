"""Command lines in processes of their own, each forked from one that has loaded the command and read what ships.

A process that starts afresh loads modules for most of a second before it reads its first word. Where it is the command
that is looked at, and not how it starts, this saves that second each time.
"""

import json
import os
import subprocess
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from tempfile import TemporaryFile
from threading import Timer
from typing import NamedTuple

#: the packages of what commands load sooner or later
LOADED = ("rtshcua.cli", "rtshcua.ground", "rtshcua.adapters.files")


class Ended(NamedTuple):
    """What a command came to."""

    code: int
    out: str
    err: str


class Forked:
    """The process that has loaded the commands. Whoever waits too long for one ends with all of them."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process

    def run(self, words: Sequence[str], folder: Path, patience_s: float) -> Ended:
        """`rtshcua` with these words in a folder, under the environment of now. Raises TimeoutError."""
        given, taken = self._process.stdin, self._process.stdout
        assert given is not None
        assert taken is not None
        print(json.dumps([list(words), str(folder), dict(os.environ)]), file=given, flush=True)
        late = Timer(patience_s, self._process.kill)
        late.start()
        try:
            answer = taken.readline()
        finally:
            late.cancel()
        if not answer:
            raise TimeoutError(f"{patience_s} s were not enough for {words}")
        return Ended(*json.loads(answer))


@contextmanager
def forked() -> Iterator[Forked]:
    """Such a process, as long as it is wanted."""
    command = [sys.executable, __file__]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            yield Forked(process)
        finally:
            process.kill()


def _serve() -> None:
    """Read one command line after the other, and say what each came to."""
    for package in map(import_module, LOADED):
        for each in walk_packages(package.__path__, f"{package.__name__}."):
            if not each.name.endswith("__main__"):
                import_module(each.name)
    _warm()
    for line in sys.stdin:
        words, folder, environment = json.loads(line)
        with TemporaryFile() as out, TemporaryFile() as err:
            child = os.fork()
            if child == 0:
                os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
                os.dup2(out.fileno(), 1)
                os.dup2(err.fileno(), 2)
                os.chdir(folder)
                os.environ.clear()
                os.environ.update(environment)
                os._exit(_main(words))
            _, status = os.waitpid(child, 0)
            told = [os.waitstatus_to_exitcode(status)]
            for file in (out, err):
                file.seek(0)
                told.append(file.read().decode())
        print(json.dumps(told), flush=True)


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
        for stream in (sys.stdout, sys.stderr):
            stream.flush()


if __name__ == "__main__":
    _serve()
