"""The process that reads one log, given as its standard input, with limits on its memory and its time.

It writes reports as lines of JSON to the descriptor in its arguments, and nothing else: what the libraries print is
dropped. Arguments: the kind of the log, the descriptor.
"""

import os
import resource
import sys
from collections.abc import Callable
from importlib import import_module

import msgspec

from rtshcua.adapters.autopilot_log.reports import NO_LIBRARY, UNREADABLE, ReadFailed, ReadLog, ReadSoFar, Report

#: memory besides the file itself, in octets: libraries need 400 MB of addresses, the track of an hour 200 MB at most
_MEMORY = 2 << 30
#: seconds of computing; pyulog reads some 10 MB a second
_SECONDS, _OCTETS_A_SECOND = 20, 1 << 20


def main(kind: str, descriptor: int) -> None:
    """Read the log and report it."""
    size = os.fstat(0).st_size
    _limit(resource.RLIMIT_AS, _MEMORY + size)
    _limit(resource.RLIMIT_CPU, _SECONDS + size // _OCTETS_A_SECOND)
    _limit(resource.RLIMIT_CORE, 0)
    os.environ.pop("PYMAVLINK_FAST_INDEX", None)  # the slow index of pymavlink never ends if a length is 0
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)

    def report(what: Report) -> None:
        with os.fdopen(descriptor, "wb", closefd=False) as file:
            file.write(msgspec.json.encode(what) + b"\n")

    report(_read(kind, size, lambda octets: report(ReadSoFar(octets))))


def _limit(what: int, most: int) -> None:
    """Limit this process, which may already be limited to less."""
    hard = resource.getrlimit(what)[1]
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(what, (most, most))


def _read(kind: str, size: int, progress: Callable[[int], None]) -> ReadLog | ReadFailed:
    try:
        library = import_module(f"rtshcua.adapters.autopilot_log.{kind}")  # late: its package may be missing
        found: ReadLog | ReadFailed = library.read_log("/dev/fd/0", size, progress)
        return found
    except ImportError as error:
        return ReadFailed(NO_LIBRARY, error.name or "")
    except MemoryError:
        return ReadFailed(UNREADABLE, "reading it takes too much memory")
    except Exception as error:  # noqa: BLE001  whatever a library raises, the file is at fault
        return ReadFailed(UNREADABLE, f"{type(error).__name__}: {error}"[:200])


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
