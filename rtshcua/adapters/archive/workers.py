"""Verification spread over processes of this machine, or over a cluster."""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Protocol, Self

from rtshcua.adapters.archive.entry import Examined
from rtshcua.adapters.archive.examine import Task, examine

#: octets of logs for which it is not worth it to start processes
_LITTLE = 4 << 20


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Workers(Protocol):
    """Whoever verifies logs; the answers come in the order of the tasks."""

    def examine(self, tasks: Sequence[Task]) -> Iterator[Examined]:
        """Verifies these logs."""

    def close(self) -> None:
        """Lets them go."""


class Processes:
    """As many processes as there are cores, or `jobs`; they start with the first work that is worth it."""

    def __init__(self, jobs: int | None = None) -> None:
        self._jobs = jobs or cores()
        self._pool: ProcessPoolExecutor | None = None

    def examine(self, tasks: Sequence[Task]) -> Iterator[Examined]:
        """Verifies these logs, the largest first."""
        if self._jobs == 1 or len(tasks) == 1 or (self._pool is None and sum(t.entry.bytes for t in tasks) < _LITTLE):
            return map(examine, tasks)
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self._jobs, mp_context=get_context("spawn"))
        return self._pool.map(examine, tasks)

    def close(self) -> None:
        """Ends the processes."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
