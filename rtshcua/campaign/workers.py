"""Who flies many flights: the cores of this machine, or (extra `cluster`) the workers of a Dask scheduler.

A worker that dies takes no flight with it: it is flown again, by another. Only a flight that a process died of twice is
given up, and counts as a failure.
"""

import errno
import os
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing import get_context
from typing import Any, Final, Protocol, TypeVar

F = TypeVar("F", bound="Numbered")
R = TypeVar("R", bound="Numbered")
F_contra = TypeVar("F_contra", bound="Numbered", contravariant=True)
R_co = TypeVar("R_co", bound="Numbered", covariant=True)


class Numbered(Protocol):
    """A flight, or what came of it."""

    @property
    def number(self) -> int:
        """Which one of those that are to be flown."""
        ...


class Work(Protocol[F_contra, R_co]):
    """How flights are flown; it goes to another process, or another machine, with each of them."""

    def fly(self, flight: F_contra) -> R_co:
        """Fly one."""
        ...

    def lost(self, flight: F_contra) -> R_co:
        """What is to be said of one whose process died, more than once."""
        ...


class FlightWorkers(Protocol):
    """Whoever flies; what comes of flights comes as it is there."""

    def fly(self, work: Work[F, R], flights: Sequence[F]) -> Iterator[R]:
        """Flies these."""
        ...

    def close(self) -> None:
        """Lets them go."""
        ...


#: how often a process may die while it flies a flight
_MOST_DEATHS: Final = 2
#: how long flights are waited for, in seconds, before `look` is called again; and between two looks at a cluster
_LOOK_S: Final = 0.5
_POLL_S: Final = 0.1
#: what is called while flights are waited for; it raises where they are not to be waited for any more
Look = Callable[[], None]


def _on() -> None:
    """They are waited for."""


class Here:
    """This process alone."""

    def fly(self, work: Work[F, R], flights: Sequence[F]) -> Iterator[R]:
        """Flies these, one after the other."""
        return (work.fly(flight) for flight in flights)

    def close(self) -> None:
        """There is nobody to let go."""


class WorkerProcesses:
    """`jobs` processes, as many as there are cores if it is not said."""

    def __init__(self, jobs: int | None = None, look: Look = _on) -> None:
        self._jobs = jobs or cores()
        self._look = look
        self._pool: ProcessPoolExecutor | None = None

    def fly(self, work: Work[F, R], flights: Sequence[F]) -> Iterator[R]:
        """Flies these, all at once."""
        left = {flight.number: flight for flight in flights}
        deaths = 0
        while left:
            # After a death nobody knows which flight it was: they are flown one by one until it dies again.
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
        try:
            while waits:
                self._look()
                for future in _soon(waits):
                    waits.remove(future)
                    yield future.result()
        finally:
            for future in futures:
                future.cancel()

    def close(self) -> None:
        """Ends the processes; what they fly is not waited for."""
        pool, self._pool = self._pool, None
        if pool is not None:
            for process in list((pool._processes or {}).values()):
                with suppress(OSError):
                    process.terminate()
            pool.shutdown(wait=True, cancel_futures=True)


class DaskWorkers:
    """The workers of a scheduler, at an address such as `tcp://10.0.0.1:8786`. Raises OSError where there is none.

    They have this package installed, in this version. How connections are secured (`tls://`) is Dask's configuration.
    """

    def __init__(self, address: str, look: Look = _on) -> None:
        self._look = look
        from distributed import Client  # noqa: PLC0415  # an extra, and slow to load

        try:
            self._client: Any = _loose(Client)(address, timeout=10)
        except (OSError, ValueError):
            raise OSError(errno.EHOSTUNREACH, "no cluster answers", address) from None

    def fly(self, work: Work[F, R], flights: Sequence[F]) -> Iterator[R]:
        """Flies these; one whose worker is lost is given to another."""
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
                done = [future for future in waits if future.done()]  # each asked once: it may be done a moment later
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
        """Leaves the cluster."""
        self._client.close()


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _soon(futures: Collection[Future[R]]) -> Iterator[Future[R]]:
    """Those that are done before it is time to look again."""
    with suppress(TimeoutError):
        yield from as_completed(futures, timeout=_LOOK_S)


def _loose(untyped: Any) -> Any:
    """Something of Dask, which says nothing of its types."""
    return untyped


def _quiet() -> None:
    """Ctrl-C is for the process that was started; it ends these."""
    import signal  # noqa: PLC0415

    signal.signal(signal.SIGINT, signal.SIG_IGN)
