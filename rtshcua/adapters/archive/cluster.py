"""Verification spread over a cluster by Dask (extra `cluster`).

Its workers have this package installed and the archive's folder mounted at the same path; each reads the logs itself
and compares their SHA-256. Their word is believed: a cluster is as trusted as this machine. How connections are secured
(`tls://`) is Dask's configuration.
"""

import errno
from collections.abc import Iterator, Sequence

from distributed import Client

from rtshcua.adapters.archive.entry import VerifiedLog
from rtshcua.adapters.archive.examine import Task, examine


class SchedulerWorkers:
    """The workers of a scheduler, at an address such as `tcp://10.0.0.1:8786`. Raises OSError where there is none."""

    def __init__(self, address: str) -> None:
        try:
            self._client = Client(address, timeout=10)
        except (OSError, ValueError):
            raise OSError(errno.EHOSTUNREACH, "no cluster answers", address) from None

    def examine(self, tasks: Sequence[Task]) -> Iterator[VerifiedLog]:
        """Verifies these logs; one whose worker is lost is given to another."""
        futures = self._client.map(examine, tasks, pure=False)
        yield from self._client.gather(futures)

    def close(self) -> None:
        """Leaves the cluster."""
        self._client.close()
