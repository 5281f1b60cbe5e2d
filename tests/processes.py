"""`pytest -n N`: run the tests in N processes, forked after import and collection.

Import and collection take longer than the tests of any file, so they are done once. One process runs a whole file, so
that its shared fixtures are made once, and then requests the next file; tests that are marked `long` are handed out one
by one, and first.
"""

import gc
import os
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import groupby
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from pathlib import Path
from tempfile import TemporaryFile
from types import SimpleNamespace
from typing import Any

import pytest
from _pytest.capture import FDCapture
from _pytest.unraisableexception import collect_unraisable

#: how long worker processes may take to end
PATIENCE_S = 10.0
#: the niceness of computing processes, which would otherwise delay flights in real time
NICER = 5
#: the final message of a process that ran all its tests and tore down their fixtures
DONE = "done"


@dataclass
class Worker:
    """A worker process: its assigned tests, and the running one.

    `owes`: the report of the running test is missing; `heard_s`: the time of the last message; `why`: a failure outside
    tests; `done`: it has reported its end.
    """

    number: int
    process: int
    pipe: Connection
    given: list[int] = field(default_factory=list)
    begun: int | None = None
    owes: bool = False
    heard_s: float = field(default_factory=time.monotonic)
    why: str = ""
    done: bool = False

    @property
    def node(self) -> SimpleNamespace:
        """A field of xdist's reports, with which the terminal prints the letters of all files in a row."""
        name = f"p{self.number}"
        return SimpleNamespace(gateway=SimpleNamespace(id=name), _workerinfocache=f"[{name}]")


class Crashed(Exception):
    """A process failed before its first test, or a test was lost."""


class Processes:
    """Runs the tests of a session in `number` processes; each calls `ended` at its end.

    A process without a message for longer than `most_s` is ended (0: never).
    """

    def __init__(self, number: int, ended: Callable[[], None], most_s: float = 0) -> None:
        self._number, self._ended, self._most_s = number, ended, most_s
        self._workers: list[Worker] = []
        self._begun = 0

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool | None:
        if session.config.option.collectonly or (
            session.testsfailed and not session.config.option.continue_on_collection_errors
        ):
            return None
        files = in_order(session.items)
        session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]  one folder for all processes
        try:
            for _ in range(min(self._number, len(files))):
                self._fork(session)
            while self._workers:
                for pipe in wait([worker.pipe for worker in self._workers], 1.0 if self._most_s else None):
                    worker = next(each for each in self._workers if each.pipe is pipe)
                    self._hear(session, worker, files)
                    if session.shouldfail:
                        raise session.Failed(session.shouldfail)
                    if session.shouldstop:
                        raise session.Interrupted(session.shouldstop)
                self._end_those_that_hang()
        finally:
            _end(self._workers)
        if self._begun != len(session.items):
            raise Crashed(f"{self._begun} of {len(session.items)} tests were begun")
        return True

    def _fork(self, session: pytest.Session) -> None:
        """Start another process."""
        number = max((worker.number for worker in self._workers), default=-1) + 1
        own, other = Pipe()
        sys.stdout.flush()
        sys.stderr.flush()
        with warnings.catch_warnings():  # computing libraries release their threads before a fork
            warnings.simplefilter("ignore", DeprecationWarning)
            process = os.fork()
        if process:
            other.close()
            self._workers.append(Worker(number, process, own))
            return
        code = 1
        with suppress(KeyboardInterrupt, OSError):  # Ctrl-C, or the parent is gone: the parent reports it
            own.close()
            for worker in self._workers:
                worker.pipe.close()
            try:
                if computes(number):
                    os.nice(NICER)
                _become(session.config, number, other)
                _run(session, other)
                self._ended()
                other.send(DONE)
                code = 0
            except Exception:  # noqa: BLE001  told where it is seen
                other.send(traceback.format_exc())
        os._exit(code)

    def _hear(self, session: pytest.Session, worker: Worker, files: list[list[int]]) -> None:
        """Handle a message: the test that begins, a report, or (None) a request for another file."""
        try:
            said = worker.pipe.recv()
            worker.heard_s = time.monotonic()
            if said is None:
                file = next_file(worker, files)
                worker.given += file
                worker.pipe.send(file)
                return
        except (EOFError, OSError):
            self._lost(session, worker, files)
            return
        if isinstance(said, int | str) and worker.owes:
            self._failed(session, worker, "nothing was reported of it")
        if isinstance(said, int):
            worker.given.remove(said)
            worker.begun, worker.owes = said, True
            self._begun += 1
        elif isinstance(said, str):
            worker.done, worker.why = said == DONE, said
        else:
            hook = session.config.hook
            report = hook.pytest_report_from_serializable(config=session.config, data=said)
            worker.owes = worker.owes and report.nodeid != session.items[worker.begun].nodeid
            report.node = worker.node
            hook.pytest_runtest_logreport(report=report)

    def _lost(self, session: pytest.Session, worker: Worker, files: list[list[int]]) -> None:
        """Handle the end of a process. If it was not done, its test fails, and another process runs its remaining
        tests.
        """
        self._workers.remove(worker)
        worker.pipe.close()
        code = os.waitstatus_to_exitcode(os.waitpid(worker.process, 0)[1])
        if code == 0 and worker.done:
            return
        self._failed(session, worker, worker.why or f"its process ended with {code}")
        if worker.given:
            files.append(worker.given)
        if files:
            self._fork(session)

    def _end_those_that_hang(self) -> None:
        """End a process whose test takes too long: pytest prints its stack, and `_lost` counts it as failed."""
        if not self._most_s:
            return
        for worker in self._workers:
            silent_s = time.monotonic() - worker.heard_s
            if silent_s > self._most_s:
                worker.why = f"it took longer than {self._most_s:g} s"
                os.kill(worker.process, signal.SIGABRT if silent_s < self._most_s + PATIENCE_S else signal.SIGKILL)

    def _failed(self, session: pytest.Session, worker: Worker, why: str) -> None:
        """Count an error outside of tests as a failure of the last begun test."""
        if worker.begun is None:
            raise Crashed(why)
        item = session.items[worker.begun]
        report = pytest.TestReport(item.nodeid, item.location, {}, "failed", why, "call")
        report.node = worker.node  # type: ignore[attr-defined]
        session.config.hook.pytest_runtest_logreport(report=report)


def in_order(items: Sequence[pytest.Item]) -> list[list[int]]:
    """Return the numbers of the tests of each file; a long test is by itself.

    Long tests and flights in real time come last: two of three processes start at that end, see `next_file`. Many small
    files come before them, so that all processes end at about the same time.
    """

    def apart(each: tuple[int, pytest.Item]) -> tuple[Path, int | None]:
        at, item = each
        return item.path, at if item.get_closest_marker("long") else None

    def order(file: list[int]) -> tuple[bool, ...]:
        item = items[file[0]]
        folders = item.path.parts
        return item.get_closest_marker("long") is not None, "integration" in folders, "unit" in folders

    return sorted(([at for at, _ in group] for _, group in groupby(enumerate(items), apart)), key=order)


def computes(number: int) -> bool:
    """Return whether a process starts with the first files, as every third does, or with the last ones, the flights."""
    return number % 3 == 0


def next_file(worker: Worker, files: list[list[int]]) -> list[int]:
    """Return the next file for a process, from its end of the list, until both ends meet.

    Flights in real time mostly wait. To keep the processors busy, two of three processes fly them while the third
    computes.
    """
    return files.pop(0 if computes(worker.number) else -1) if files else []


def _end(workers: list[Worker]) -> None:
    """Wait a while for remaining processes: they clean up once the parent is gone, or at Ctrl-C."""
    for worker in workers:
        worker.pipe.close()
    until_s = time.monotonic() + PATIENCE_S
    for worker in workers:
        while os.waitpid(worker.process, os.WNOHANG) == (0, 0):
            if time.monotonic() > until_s:
                os.kill(worker.process, signal.SIGTERM)
            time.sleep(0.02)


class _Told:
    """Sends reports to the parent: one per test, and of fixtures that failed or are timed."""

    def __init__(self, config: pytest.Config, pipe: Connection) -> None:
        self._config, self._pipe = config, pipe
        self._timed = config.option.durations is not None

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" or not report.passed or self._timed:
            to = self._config.hook.pytest_report_to_serializable
            self._pipe.send(to(config=self._config, report=report))


def _become(config: Any, number: int, pipe: Connection) -> None:
    """Set up the private parts of a process: output, capturing, temporary folder."""
    plugins = config.pluginmanager
    plugins.unregister(name="terminalreporter")
    plugins.register(_Told(config, pipe), "told")
    captured = plugins.getplugin("capturemanager")._global_capturing
    for stream in (captured.out, captured.err):
        if isinstance(stream, FDCapture):  # existing references keep the same file
            with TemporaryFile() as own:
                os.dup2(own.fileno(), stream.tmpfile.fileno(), inheritable=False)
    factory = config._tmp_path_factory
    factory._basetemp = factory.mktemp(f"process{number}-")


def _run(session: pytest.Session, pipe: Connection) -> None:
    """Run the assigned tests."""
    items = _given(pipe)
    at = next(items, None)
    try:
        while at is not None:
            following = next(items, None)
            pipe.send(at)
            item, after = session.items[at], None if following is None else session.items[following]
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
            at = following
    finally:
        session._setupstate.teardown_exact(None)  # the rest after an interruption
    gc.collect()
    collect_unraisable(session.config)


def _given(pipe: Connection) -> Iterator[int]:
    """Yield the tests to run. The next file is requested before the last test of a file begins."""
    while True:
        pipe.send(None)
        file = pipe.recv()
        if not file:
            return
        yield from file
