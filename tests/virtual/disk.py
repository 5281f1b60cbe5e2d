"""Evidence on a faulty disk, in virtual time: the writer's work is done between turns of the loop."""

from pathlib import Path

from reference.faulty_disk import FaultyDisk
from rtshcua.adapters.store.evidence_file import SYNC_S, EvidenceFile, Keeper, Lateness
from rtshcua.virtual.vehicle import VirtualClock


class DiskSink:
    """The evidence sink over a file that the test controls. `hangs`: a write does not return."""

    def __init__(self, path: Path, disk: FaultyDisk, clock: VirtualClock) -> None:
        self.path, self.disk = path, disk
        self.hangs = False
        self._clock = clock
        self._keeper = Keeper(EvidenceFile(path, disk))
        self._lateness = Lateness()
        self._queue: list[tuple[bytes, int]] = []
        self._given = 0
        self._came_s = 0.0

    @property
    def lines(self) -> list[bytes]:
        return self.path.read_bytes().splitlines(keepends=True)

    @property
    def kept(self) -> int:
        return self._keeper.written

    @property
    def synced(self) -> int:
        return self._keeper.synced

    def append(self, line: bytes, durability: int) -> int:
        self._given += 1
        self._queue.append((line, durability))
        self._lateness.given(self._given, durability)
        return self._given

    def trouble(self) -> str | None:
        self._turn()
        if not self._keeper.troubles.empty():
            return self._keeper.troubles.get()
        return None if self._keeper.failing else self._lateness.stuck(self.synced, self._now_s())

    def late(self) -> str | None:
        return None if self._keeper.failing else self._lateness.late(self.synced, self._now_s())

    def close(self) -> None:
        self._turn()
        self._keeper.close()

    def _now_s(self) -> float:
        return self._clock.elapsed_us / 1e6

    def _turn(self) -> None:
        now_s = self._now_s()
        if self.hangs:
            return
        if self._queue:
            batch, self._queue = self._queue, []
            self._came_s = now_s
            self._keeper.take(batch, now_s)
        elif self._keeper.busy and now_s - self._came_s >= SYNC_S:
            self._keeper.take([], now_s)
