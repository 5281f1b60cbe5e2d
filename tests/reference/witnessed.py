"""Logs for tests of witnesses: a recorder that signs with real keys, forks of it, and witnesses that keep state."""

from collections.abc import Iterable
from copy import deepcopy

from rtshcua.evidence.log_writer import Recorder, origin_of
from rtshcua.evidence.witnessing.cosign import cosign
from rtshcua.evidence.witnessing.submission import Submission, anchor
from rtshcua.evidence.witnessing.witness import CosignRequest, Declined, LastCosigned, judge
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import Duty, SigningKey

BOOT = bytes(range(16))
VEHICLE = "quad 07+é"
ORIGIN = origin_of(VEHICLE, BOOT.hex())
LOG_KEY = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)
WITNESSES = [SigningKey.from_seed(bytes([80 + n]) * 32, duty=Duty.WITNESS, development=True) for n in range(3)]
PUBLIC = [key.public for key in WITNESSES]


def log_keys(vehicle: str) -> Iterable[bytes]:
    """Return the log keys of the trust root."""
    return (LOG_KEY.public,) if vehicle == VEHICLE else ()


class Log:
    """A growing log. A fork shares the earlier records and the key of the present epoch."""

    def __init__(self, seed: int = 1, *, bundle: bytes = b"bundle") -> None:
        self.seeds = iter(range(seed, 100_000))
        self.recorder = Recorder(lambda text: LOG_KEY.sign(text, duty=Duty.LOG), LOG_KEY.public, self.draw)
        self.submission = Submission()
        self.lines: list[bytes] = []
        self.ms = 0
        self.add(
            self.recorder.genesis(
                self.now(), bundle=bundle, root=b"root", boot=BOOT, vehicle=VEHICLE, mission="m", mode="software"
            )
        )

    def draw(self) -> bytes:
        return next(self.seeds).to_bytes(32, "big")

    def now(self) -> Now:
        self.ms += 1
        return Now(5_000_000 + self.ms * 1000, 1_750_000_000_000_000 + self.ms * 1000, 2_000)

    def add(self, line: bytes) -> str | None:
        self.lines.append(line)
        return self.submission.take(line)

    def effects(self, count: int, event: str = "said") -> None:
        for _ in range(count):
            self.add(self.recorder.effect(self.now(), event))

    def seal(self) -> str:
        return self.add(self.recorder.seal(self.now())) or ""

    def close(self) -> str:
        return self.add(self.recorder.close(self.now(), ending="completed", tlog=None)) or ""

    def recover(self) -> str:
        """Append a recovery, which a holder of the log key can always write."""
        self.recorder = Recorder.resumed(
            self.recorder._head, ORIGIN, lambda text: LOG_KEY.sign(text, duty=Duty.LOG), LOG_KEY.public, self.draw
        )
        return self.add(self.recorder.recover(self.now(), discarded_bytes=0, discarded_digest=bytes(32))) or ""

    def fork(self) -> "Log":
        """Another future of this log, by a holder of its keys."""
        other = object.__new__(Log)
        other.seeds, other.ms = iter(range(100_000, 200_000)), self.ms
        other.lines, other.submission = list(self.lines), deepcopy(self.submission)
        other.recorder = object.__new__(Recorder)
        for name in Recorder.__slots__:
            value = getattr(self.recorder, name)
            setattr(other.recorder, name, fork_of(value) if name == "_head" else value)
        other.recorder._draw = other.draw
        return other

    @property
    def notes(self) -> list[str]:
        return self.submission._notes


def fork_of(head: object) -> object:
    """A copy of a head, hash objects included, which `deepcopy` cannot take."""
    other = object.__new__(type(head))
    for name in type(head).__slots__:  # type: ignore[attr-defined]
        value = getattr(head, name)
        setattr(other, name, value.copy() if name == "_hash" else deepcopy(value))
    return other


class Judge:
    """A witness in memory."""

    def __init__(self, key: SigningKey = WITNESSES[0]) -> None:
        self.key = key
        self.seen: dict[str, LastCosigned] = {}
        self.time_s = 1_750_000_000

    def consider(self, request: CosignRequest) -> str | Declined:
        """The anchor, or the refusal."""
        origin = request.note.partition("\n")[0]
        found = judge(request, self.seen.get(origin), log_keys)
        if isinstance(found, Declined):
            return found
        self.seen[origin] = found
        made = anchor(request.note, self.line(found.text), [self.key.public])
        assert made is not None
        return made

    def line(self, text: str) -> str:
        self.time_s += 1
        return cosign(text, self.time_s, self.key.public, lambda data: self.key.sign(data, duty=Duty.WITNESS))

    def blindly(self, note: str) -> str:
        """The cosignature of a lying witness, which signs any checkpoint."""
        made = anchor(note, self.line(note.rpartition("\n\n")[0] + "\n"), [self.key.public])
        assert made is not None
        return made
