"""Kill writers of logs, and recoveries, under load (SIGKILL): `killed.py COUNT SEED`.

A writer reports through a pipe how many lines were written and synced, as to its flight. After it was killed, the log
must contain at least these. It runs in a fork of a process without threads.
"""

import os
import select
import signal
import struct
import sys
import time
from itertools import islice
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NoReturn

from reference.crashed import LOG_KEY, signer, unverified, writes
from rtshcua.adapters.store.evidence_file import SYSTEM, Disk, EvidenceFile, EvidenceWriter, LogFile, SystemFile
from rtshcua.adapters.store.recovery import examine, recover
from rtshcua.adapters.store.writing import open_new
from rtshcua.evidence.recovery import LogState

_ACKNOWLEDGED = struct.Struct("<II")
_MOST_WAITING = 500
_LONGEST_S, _LONGEST_RECOVERY_S = 0.12, 0.03
_PATIENCE_S = 10.0


class Piecemeal(SystemFile):
    """A file that accepts a few octets at a time, so that lines can be torn."""

    __slots__ = ()

    def __init__(self, handle: int) -> None:
        super().__init__(handle)
        self.write = lambda data: os.write(handle, data[:101])


class PiecemealDisk(Disk):
    """A disk of such files."""

    def create(self, path: Path) -> LogFile:
        return Piecemeal(open_new(path))


def campaign(count: int, seed: int) -> tuple[list[str], dict[str, int]]:
    """Return the faults of the outcomes, and the amount of work."""
    wrong: list[str] = []
    done = {"killed": 0, "acknowledged": 0, "torn": 0, "whole": 0, "unbegun": 0, "recoveries killed": 0}
    for number in range(seed, seed + count):
        with TemporaryDirectory() as folder:
            text = _once(Path(folder) / "log.jsonl", Random(number), number, done)
        if text:
            wrong.append(f"{number}: {text}")
    return wrong, done


def _once(path: Path, chance: Random, number: int, done: dict[str, int]) -> str:
    inward, outward = os.pipe()
    writer = os.fork()
    if writer == 0:
        os.close(inward)
        _write(path, number, outward)
    os.close(outward)
    if chance.random() < 0.95:  # otherwise it may not have begun
        select.select([inward], [], [], _PATIENCE_S)
    time.sleep(chance.random() * _LONGEST_S)
    _kill(writer)
    written, synced = _last_of(inward)
    done["killed"] += 1
    done["acknowledged"] += written
    if synced > written:
        return f"{synced} were synced, of {written} written"
    if not path.exists() or examine(path, LOG_KEY.public).state is LogState.UNBEGUN:
        done["unbegun"] += 1
        return "the beginning is lost" if written else ""
    done[examine(path, LOG_KEY.public).state.value] += 1
    for _ in range(chance.choice((0, 1, 2))):
        recoverer = os.fork()
        if recoverer == 0:
            recover(path, signer(Random(number)))
            os._exit(0)
        time.sleep(chance.random() * _LONGEST_RECOVERY_S)
        done["recoveries killed"] += _kill(recoverer)
    found = recover(path, signer(chance)).found
    if found.state not in (LogState.TORN, LogState.WHOLE, LogState.CLOSED):
        return f"{found.state.value}: {found.reason}"
    lines = [line for line, _ in islice(writes(Random(number)), found.records + 1)]
    return unverified(path, lines, written)


def _write(path: Path, seed: int, outward: int) -> NoReturn:
    pace = Random(-seed)
    sink = EvidenceWriter(
        EvidenceFile(path, PiecemealDisk() if seed % 3 == 0 else SYSTEM), sync_s=0.01, sync_after_s=0.02
    )
    told = (0, 0)
    for line, durability in writes(Random(seed)):
        sink.append(line, durability)
        while sink.waiting > _MOST_WAITING:
            time.sleep(0.001)
        if pace.random() < 0.05:
            time.sleep(pace.random() * 0.004)
        synced = sink.synced  # before `kept`, which is never less
        now = (sink.kept, synced)
        if now != told:
            told = now
            os.write(outward, _ACKNOWLEDGED.pack(*now))
    raise AssertionError


def _kill(process: int) -> bool:
    """Kill a process; return whether it was still running."""
    os.kill(process, signal.SIGKILL)
    return os.WIFSIGNALED(os.waitpid(process, 0)[1])


def _last_of(inward: int) -> tuple[int, int]:
    with os.fdopen(inward, "rb") as pipe:
        told = pipe.read()
    whole = len(told) - len(told) % _ACKNOWLEDGED.size
    if not whole:
        return 0, 0
    written, synced = _ACKNOWLEDGED.unpack(told[whole - _ACKNOWLEDGED.size : whole])
    return written, synced


if __name__ == "__main__":
    failures, figures = campaign(int(sys.argv[1]), int(sys.argv[2]))
    print(*failures, sep="\n")
    print(figures)
    sys.exit(1 if failures else 0)
