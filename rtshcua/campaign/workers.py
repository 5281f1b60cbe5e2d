"""Run many flights in parallel: on the cores of this machine, or (extra `cluster`) on a Dask cluster.

If a worker dies, another one repeats its flight. A flight whose worker dies repeatedly counts as a failure.
"""

import errno
import os
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from threading import Thread
from typing import Any, Final, Protocol, TypeVar

F = TypeVar("F", bound="Numbered")
R = TypeVar("R", bound="Numbered")
F_contra = TypeVar("F_contra", bound="Numbered", contravariant=True)
R_co = TypeVar("R_co", bound="Numbered", covariant=True)


class Numbered(Protocol):
    """A flight or its result."""

    @property
    def number(self) -> int:
        """The flight's number."""
        ...


class Work(Protocol[F_contra, R_co]):
    """A way to fly flights; it is sent with each flight to another process or machine."""

    def fly(self, flight: F_contra) -> R_co:
        """Fly one flight."""
        ...

    def lost(self, flight: F_contra) -> R_co:
        """Return the result of a flight whose worker died repeatedly."""
        ...


class FlightWorkers(Protocol):
    """A pool of workers; results come as they are ready."""

    def fly(self, work: Work[F, R], flights: Sequence[F]) -> Iterator[R]:
        """Fly the flights; yield each result."""
        ...

    def close(self) -> None:
        """Release the workers."""
        ...


#: how often a process may die while it flies a flight
_MOST_DEATHS: Final = 2
#: s: the interval of calls of `look`, and of polling a cluster
_LOOK_S: Final = 0.5
_POLL_S: Final = 0.1
#: a function that is called while waiting for flights; it raises an exception to stop
Look = Callable[[], None]


def _on() -> None:
    """Continue waiting."""


class Here:
    """Flies in this process."""

    def fly(self, work: Work[F, R], flights: Sequence[F]) -> Iterator[R]:
        """Fly the flights one after the other."""
        return (work.fly(flight) for flight in flights)

    def close(self) -> None:
        """Do nothing: there are no workers."""


class WorkerProcesses:
    """A pool of `jobs` processes; by default one per core."""

    def __init__(self, jobs: int | None = None, look: Look = _on) -> None:
        self._jobs = jobs or cores()
        self._look = look
        self._pool: ProcessPoolExecutor | None = None

    def fly(self, work: Work[F, R], flights: Sequence[F]) -> Iterator[R]:
        """Fly the flights in parallel."""
        left = {flight.number: flight for flight in flights}
        deaths = 0
        while left:
            # After a death the flight that caused it is unknown: fly one by one until a worker dies again.
            together = list(left.values()) if not deaths else list(left.values())[:1]
            try:
                for result in self._all(work, together):
                    del left[result.number]
                    yield result
                deaths = 0 if len(together) > 1 else deaths
            except BrokenProcessPool:
                self.close()
                deaths += 1
                if deaths > _MOST_DEATHS and len(together) == 1:
                    del left[together[0].number]
                    yield work.lost(together[0])
                    deaths = 0

    def _all(self, work: Work[F, R], flights: Sequence[F]) -> Iterator[R]:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self._jobs, mp_context=get_context("spawn"), initializer=_quiet)
        futures = [self._pool.submit(work.fly, flight) for flight in flights]
        waits = set(futures)
        while waits:
            self._look()
            for future in _soon(waits):
                waits.remove(future)
                yield future.result()

    def close(self) -> None:
        """Terminate the processes without waiting for their flights."""
        pool, self._pool = self._pool, None
        if pool is not None:
            processes = list((pool._processes or {}).values())
            # The pool's own thread cancels what waits. It prints a traceback for a future that anyone else cancelled,
            # if it finds its processes dead before that future's turn.
            pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                with suppress(OSError):
                    process.terminate()
            pool.shutdown(wait=True)


class DaskWorkers:
    """The workers of a Dask scheduler at an address such as `tcp://10.0.0.1:8786`. Raise OSError if none answers.

    The workers need this version of the package. TLS (`tls://`) is configured in Dask.
    """

    def __init__(self, address: str, look: Look = _on) -> None:
        self._look = look
        from distributed import Client  # noqa: PLC0415  # an extra, and slow to load

        try:
            self._client: Any = _loose(Client)(address, timeout=10)
        except (OSError, ValueError):
            raise OSError(errno.EHOSTUNREACH, "no cluster answered", address) from None

    def fly(self, work: Work[F, R], flights: Sequence[F]) -> Iterator[R]:
        """Fly the flights; another worker repeats a flight whose worker is lost."""
        from distributed import KilledWorker  # noqa: PLC0415

        by_key = {}
        futures = []
        for flight in flights:
            future = self._client.submit(work.fly, flight, pure=False, retries=_MOST_DEATHS)
            by_key[future.key] = flight
            futures.append(future)
        try:
            waits = list(futures)
            while waits:
                self._look()
                done = [future for future in waits if future.done()]  # evaluated once: a future may finish at any time
                if not done:
                    time.sleep(_POLL_S)
                for future in done:
                    waits.remove(future)
                    try:
                        yield future.result()
                    except KilledWorker:
                        yield work.lost(by_key[future.key])
        finally:
            self._client.cancel(futures)

    def close(self) -> None:
        """Disconnect from the cluster."""
        self._client.close()


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _soon(futures: Collection[Future[R]]) -> Iterator[Future[R]]:
    """Yield the futures that finish before the next call of `look`."""
    with suppress(TimeoutError):
        yield from as_completed(futures, timeout=_LOOK_S)


def _loose(untyped: Any) -> Any:
    """Return an object of Dask, which has no type annotations, as `Any`."""
    return untyped


def _quiet() -> None:
    """Ignore SIGINT: Ctrl-C is for the parent process, which terminates the workers. End with it if it is killed."""
    import signal  # noqa: PLC0415

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
