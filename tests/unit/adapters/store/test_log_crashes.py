"""Process crashes and power cuts while a log is written or recovered lose no acknowledged line."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple

import pytest

from reference.crashed import LOG_KEY, signer, unverified, writes
from reference.power import Died, PowerDisk
from rtshcua.adapters.store.evidence_file import EvidenceFile, Keeper
from rtshcua.adapters.store.recovery import examine, recover
from rtshcua.evidence.recovery import LogState

KINDS = ("died", "torn", "late", "failed", "short", "refused")


class Crashed(NamedTuple):
    """A log written until a crash or power cut: its lines, and the numbers written and synced."""

    path: Path
    lines: list[bytes]
    written: int
    synced: int


def crashed(folder: Path, chance: Random, disk: PowerDisk, *, most: int = 80) -> Crashed:
    path, lines = folder / "log.jsonl", list[bytes]()
    keeper: Keeper | None = None
    log, at_s = writes(chance, seals=12), 0.0
    with suppress(Died, OSError):
        keeper = Keeper(EvidenceFile(path, disk))
        for _ in range(most):
            batch = [next(log) for _ in range(chance.choice((1, 1, 2, 5)))]
            lines += [line for line, _ in batch]
            at_s += chance.choice((0.0, 0.001, 0.3))
            keeper.take(batch, at_s)
            if chance.random() < 0.05:
                keeper.take([], at_s)
    return Crashed(path, lines, keeper.written if keeper else 0, keeper.synced if keeper else 0)


def campaign(folder: Path, seed: int) -> str:
    """Run one crash and its recovery, which may crash too; return the fault of the outcome, if any."""
    chance = Random(seed)
    when, kind = chance.randint(2, 260), chance.choice(KINDS)
    more = chance.random() < 0.3  # several crashes may follow

    def fault(number: int, name: str) -> str:
        return kind if number == when or (more and number > when and number % 7 == 0) else ""

    disk = PowerDisk(fault)
    cut = chance.random() < 0.7
    log = crashed(folder, chance, disk)
    if cut:
        disk.cut_power(chance)
    for _ in range(chance.choice((0, 0, 1, 3))):
        when = chance.randint(0, 9)
        again = PowerDisk(lambda number, name, when=when: kind if number == when else "")
        with suppress(Died, OSError):
            recover(log.path, signer(chance), disk=again)
        if cut and kind in ("died", "torn", "late"):
            again.cut_power(chance)
    wrong = outcome(log, chance, cut=cut, doubtful=disk.doubtful)
    return f"seed {seed}: {wrong}" if wrong else ""


def outcome(log: Crashed, chance: Random, *, cut: bool, doubtful: bool) -> str:
    """Return the fault of a recovered log, if any. After a power cut only synced lines must remain.

    `doubtful`: a sync had failed, so a power cut may lose lines before a signed record.
    """
    if not log.path.exists() or examine(log.path, LOG_KEY.public).state is LogState.UNBEGUN:
        return "" if log.synced == 0 and (cut or log.written == 0) else "the beginning is lost"
    done = recover(log.path, signer(chance))
    if cut and doubtful and done.found.state is LogState.TAMPERED:
        return ""
    if done.found.state not in (LogState.TORN, LogState.WHOLE, LogState.CLOSED):
        return f"{done.found.state} {done.found.reason}"
    return unverified(log.path, log.lines, log.synced if cut else log.written)


def campaigns(seeds: range) -> list[str]:
    wrong = []
    for seed in seeds:
        with TemporaryDirectory() as folder:
            wrong.append(campaign(Path(folder), seed))
    return [text for text in wrong if text]


def each_operation(kinds: Sequence[str], step: int) -> list[str]:
    """Return the faults found after a failure at each (or each nth) operation, with and without a power cut."""
    wrong, number = [], 0
    over = False
    while not over:
        for kind in kinds:
            for cut in (False, True):
                with TemporaryDirectory() as folder:
                    disk = PowerDisk(lambda now, name, number=number, kind=kind: kind if now == number else "")
                    log = crashed(Path(folder), Random(4), disk, most=30)
                    if cut:
                        disk.cut_power(Random(number))
                    text = outcome(log, Random(number), cut=cut, doubtful=disk.doubtful)
                if text:
                    wrong.append(f"{kind} at {number}, power {'cut' if cut else 'on'}: {text}")
                over = disk.operations <= number
        number += step
    return wrong


@pytest.mark.slow
def test_acknowledged_lines_survive_process_or_power_failure() -> None:
    assert campaigns(range(25)) == []


@pytest.mark.slow
def test_acknowledged_lines_survive_one_failed_operation() -> None:
    assert each_operation(KINDS, 29) == []


@pytest.mark.soak
def test_acknowledged_lines_survive_repeated_failures() -> None:
    assert campaigns(range(1_000, 11_000)) == []


@pytest.mark.soak
def test_acknowledged_lines_survive_failure_of_any_operation() -> None:
    assert each_operation(KINDS, 1) == []
