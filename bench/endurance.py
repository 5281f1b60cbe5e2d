"""Endurance: the memory growth of a flight of two hours in virtual time.

Leg after leg, back and forth, with evidence to a file, with the code of a real run except for the vehicle. The memory
of the process is compared after half an hour and at the end. Exits with 1 when it grew by more than the limit.
"""

import gc
import sys
import tempfile
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from rtshcua.adapters.loop import RunLoop
from rtshcua.adapters.store.evidence_file import EvidenceFile
from rtshcua.model.durability import WRITTEN
from virtual import case
from virtual.flight import Flight
from virtual.long_flight import legs

HOURS = 2
HOUR_US = 3_600 * case.S
STEPS = 400  # more steps than are reached
LIMIT_BYTES = 2 << 20
LIMIT_OBJECTS = 20  # per flown step: each step keeps its last decision


class Sink(EvidenceFile):
    """An evidence file in virtual time: appended lines count as written."""

    kept = synced = 0

    def append(self, line: bytes, durability: int) -> int:  # type: ignore[override]  # as an `EvidenceSink` returns it
        """Write one line, without a sync."""
        super().append(line, WRITTEN)
        self.kept = self.synced = self.kept + 1
        return self.kept

    def trouble(self) -> None:
        """None."""

    late = trouble


def flight() -> Flight:
    """Legs without end."""
    mission, policy, config = legs(STEPS)
    return Flight(case.seal(mission, policy), config)


def held() -> tuple[int, int]:
    """Return the memory of the process in bytes, and the number of objects."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4_096, len(gc.get_objects())


def main() -> int:
    """Fly and print; return 1 if memory grew too much."""
    with tempfile.TemporaryDirectory() as name:
        flown = flight()
        clock, sink = flown.clock, Sink(Path(name) / "log.jsonl")
        flown.loop = RunLoop(flown.runtime, flown.vehicle, sink, clock, lambda *_: None, 100_000)
        start = process_time()
        marks = []
        for until_us in (HOUR_US // 2, HOURS * HOUR_US):
            while clock.elapsed_us < until_us:
                ending = flown.loop.turn()
                assert ending is None, ending
            marks.append(held())
        took = process_time() - start
        sink.close()
    view = flown.runtime.view(clock.now())
    grown, more = (after - before for before, after in zip(*marks, strict=True))
    most = LIMIT_OBJECTS * view.step
    before, after = (mark[0] / 2**20 for mark in marks)
    print(
        f"endurance: {HOURS} h in virtual time, {view.step} steps, {sink.kept} records, at "
        f"{clock.elapsed_us / 1e6 / took:.0f} times real time: memory from {before:.1f} to {after:.1f} MiB (limit "
        f"{LIMIT_BYTES >> 20} MiB more), {more} objects more (limit {most})"
    )
    return int(grown > LIMIT_BYTES or more > most)


if __name__ == "__main__":
    sys.exit(main())
