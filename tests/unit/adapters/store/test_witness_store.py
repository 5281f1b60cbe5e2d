"""A witness's state survives crashes, is stored before each cosignature, and is used only if intact."""

import os
from pathlib import Path
from typing import Any

import pytest

from reference.witnessed import LOG_KEY, ORIGIN, PUBLIC, WITNESSES, Log, log_keys
from rtshcua.adapters.store import witness
from rtshcua.adapters.store.witness import FileWitness, WitnessError, WitnessStore
from rtshcua.evidence.note import Checkpoint, sign, split
from rtshcua.evidence.witnessing.cosign import Cosignature, read_cosignature
from rtshcua.evidence.witnessing.witness import CONFLICT, CosignRequest, Declined, LastCosigned, WitnessResponse
from rtshcua.wire.keys import Duty


@pytest.fixture
def log() -> Log:
    log = Log()
    for _ in range(3):
        log.effects(2)
        log.seal()
    return log


def made(folder: Path, time_s: int = 1_000) -> FileWitness:
    return FileWitness(WitnessStore(folder, WITNESSES[0]), WITNESSES[0], log_keys, lambda: time_s)


def asked(log: Log, known: int | None, records: int = 99) -> CosignRequest:
    request = log.submission.request(known, records)
    assert request is not None
    return request


def time_of(answer: WitnessResponse | Declined, request: CosignRequest) -> int:
    assert isinstance(answer, WitnessResponse), answer
    found = read_cosignature(answer.body, split(request.note)[0], PUBLIC)
    assert isinstance(found, Cosignature)
    assert found.public == WITNESSES[0].public
    return found.time_s


def test_witness_continues_after_a_crash(tmp_path: Path, log: Log) -> None:
    first = made(tmp_path)
    assert first.known(ORIGIN) is None
    first.consider(asked(log, None, 4))
    first.store.close()
    second = made(tmp_path, time_s=900)
    assert second.known(ORIGIN) == 3
    request = asked(log, 3)
    assert time_of(second.consider(request), request) == 1_000  # time does not go back, whatever the clock says
    refusal = second.consider(asked(log, 3, 7))
    assert isinstance(refusal, Declined)
    assert (refusal.status, refusal.size) == (CONFLICT, 9)
    assert {path.stat().st_mode & 0o077 for path in (second.store.folder, *second.store.folder.iterdir())} == {0}


def test_second_process_on_a_witness_store_is_refused(tmp_path: Path) -> None:
    first = made(tmp_path)
    with pytest.raises(WitnessError) as refused:
        made(tmp_path)
    assert refused.value.slug == "in-use"
    first.store.close()
    made(tmp_path).store.close()
    WitnessStore(tmp_path, WITNESSES[1]).close()


@pytest.mark.parametrize(
    "content",
    [b"", b"{}", b'{"text":"x","signer":"","time_s":0}', b'{"text":"x","signer":"zz","time_s":0}', b"\xff", None],
)
def test_damaged_witness_memory_prevents_cosigning(tmp_path: Path, log: Log, content: bytes | None) -> None:
    first = made(tmp_path)
    first.consider(asked(log, None, 4))
    (path,) = first.store.folder.glob("*.seen")
    data = path.read_bytes()
    path.write_bytes(data.replace(b"quad", b"quid") if content is None else content)
    with pytest.raises(WitnessError) as refused:
        first.consider(asked(log, 3))
    assert refused.value.slug == "damaged"
    path.write_bytes(data)
    assert first.known(ORIGIN) == 3


def test_killed_witness_never_contradicts_itself(tmp_path: Path, log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever write fails, no cosignature is sent, and the witness knows the old or the new checkpoint."""
    steps = [("write", 1), ("fsync", 1), ("replace", 1), ("fsync", 2)]  # the file is synced, then its folder
    for number, (step, turn) in enumerate(steps):
        folder = tmp_path / str(number)
        first = made(folder)
        first.consider(asked(log, None, 4))

        left, real = [turn], getattr(os, step)

        def fail(*args: object, left: list[int] = left, real: Any = real, **more: object) -> Any:
            left[0] -= 1
            if left[0] == 0:
                raise OSError(28, "no space left")
            return real(*args, **more)

        with monkeypatch.context() as patch:
            patch.setattr(os, step, fail)
            with pytest.raises(OSError, match="no space"):
                first.consider(asked(log, 3))
        first.store.close()
        second = made(folder)
        known = second.known(ORIGIN)
        assert known == (9 if turn == 2 else 3)
        if known == 3:
            assert isinstance(second.consider(asked(log, 3)), WitnessResponse)
        second.store.close()


def test_checkpoint_is_stored_before_it_is_cosigned(tmp_path: Path, log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []
    keep, cosign = WitnessStore.keep, witness.cosign
    monkeypatch.setattr(WitnessStore, "keep", lambda *a: (order.append("keep"), keep(*a)))
    monkeypatch.setattr(witness, "cosign", lambda *a: (order.append("cosign"), cosign(*a))[1])
    assert isinstance(made(tmp_path).consider(asked(log, None)), WitnessResponse)
    assert order == ["keep", "cosign"]


def test_the_proof_of_a_lie_is_kept(tmp_path: Path, log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    first = made(tmp_path)
    first.consider(asked(log, None))
    forks = [
        sign(Checkpoint(ORIGIN, 9, bytes([n]) * 32, bytes(32), bytes(32)), LOG_KEY.public, signed) for n in range(3)
    ]
    monkeypatch.setattr(witness, "MOST_CONTRADICTIONS", 2)
    found = []
    for fork in forks:
        refusal = first.consider(CosignRequest(9, (), fork))
        assert isinstance(refusal, Declined)
        assert refusal.contradiction
        found.append(first.store.contradicted(fork))
    assert found[0] is not None
    assert found[0].read_text() == forks[0]
    assert found[2] is None
    assert first.store.contradicted(forks[0]) == found[0]


def signed(data: bytes) -> bytes:
    return LOG_KEY.sign(data, duty=Duty.LOG)


def test_seen_round_trip(tmp_path: Path, log: Log) -> None:
    store = WitnessStore(tmp_path, WITNESSES[0])
    seen = LastCosigned(split(log.notes[1])[0], bytes(range(32)))
    store.keep(ORIGIN, seen, 7)
    assert store.seen(ORIGIN) == (seen, 7)
    assert store.seen("other") is None
