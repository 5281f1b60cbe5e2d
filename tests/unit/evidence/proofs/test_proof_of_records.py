"""Proofs made from logs, and their content for a holder of the file and a pinned root key."""

import json

import pytest

from reference.sealed_log import LOG_KEY, PIN, VEHICLE, SealedLog, now, resumed, sealed_log, sign
from reference.seeds import epoch_seeds
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.proofs.check import Proven, check_proof
from rtshcua.evidence.proofs.cose_receipt import ReceiptClaim, check_receipt, make_receipt
from rtshcua.evidence.proofs.file import ProofKind
from rtshcua.evidence.proofs.make import (
    anchored,
    find,
    prove_consistency,
    prove_inclusion,
    receipt_of,
    with_cosignatures,
)
from rtshcua.evidence.records import Close, DecisionRecord, Effect, Genesis, Recover, Seal
from rtshcua.evidence.witnessing.cosign import cosign
from rtshcua.wire.keys import Duty, SigningKey
from virtual import case


def proof(made: bytes | Flaw) -> bytes:
    assert isinstance(made, bytes), made
    return made


def proven(data: bytes, pin: bytes = PIN) -> Proven:
    checked = check_proof(data, pin)
    assert isinstance(checked, Proven), checked
    return checked


def slug(made: bytes | Flaw | Proven | ReceiptClaim | object) -> str:
    assert isinstance(made, Flaw), made
    return made.slug


@pytest.fixture(params=[False, True], ids=["sealed", "recovered"])
def log(request: pytest.FixtureRequest) -> SealedLog:
    return sealed_log(recovers=request.param)


WITNESS = case.KEYS[Duty.WITNESS]


def cosigned(log: SealedLog, at: int, time_s: int = 1_750_000_100, key: SigningKey = WITNESS) -> str:
    """The anchor that a witness makes of the checkpoint in signed record `at`."""
    note = json.loads(log.lines[at])["checkpoint"]
    text = note.rpartition("\n\n")[0] + "\n"
    return str(note) + cosign(text, time_s, key.public, lambda data: key.sign(data, duty=key.duty))


def test_cosignatures_are_appended_below_checkpoint(log: SealedLog) -> None:
    plain = proof(prove_inclusion(lambda: log.lines, 3))
    assert not proven(plain).believed.anchored
    at = log.signed[1]
    stranger = SigningKey.from_seed(bytes([77]) * 32, duty=Duty.WITNESS)
    forged = cosigned(log, at)[:-8] + "AAAAAA=\n"
    anchors = [cosigned(log, log.signed[2]), forged, cosigned(log, at, key=stranger), "junk", cosigned(log, at)]
    data = with_cosignatures(plain, [*anchors, cosigned(log, at, 1_750_000_200)])
    believed = proven(data).believed
    assert believed.anchored
    assert [(each.public, each.time_s) for each in believed.cosigned] == [(WITNESS.public, 1_750_000_100)]
    assert data == plain + cosigned(log, at).splitlines(keepends=True)[-1].encode()
    assert with_cosignatures(plain, anchors[:-1]) == plain
    for line in (forged, anchors[2], cosigned(log, log.signed[2])):
        assert slug(check_proof(plain + line.splitlines(keepends=True)[-1].encode(), PIN)) in (
            "proof/note", "proof/cosignature",
        )  # fmt: skip
    assert slug(check_proof(data + cosigned(log, at, 1).splitlines(keepends=True)[-1].encode(), PIN)) == "proof/note"


def test_anchors_in_records_are_found() -> None:
    log = sealed_log(closed=False)
    note = cosigned(log, log.signed[1])
    recorder = resumed(list(log.lines), epoch_seeds())
    line = recorder.effect(now(40), "anchored", detail=note)
    said = recorder.effect(now(41), "said", detail='"event":"anchored"')
    assert list(anchored([*log.lines, line, said, b',"event":"anchored"\n'])) == [note]


@pytest.mark.unmeasured
def test_every_record_is_proven_under_the_first_signed_one_after_it(log: SealedLog) -> None:
    for number, line in enumerate(log.lines):
        data = proof(prove_inclusion(lambda: log.lines, number))
        shown = proven(data)
        last = number == len(log.lines) - 1
        assert shown.kind is (ProofKind.RECORD if last else ProofKind.INCLUSION)
        assert shown.checkpoint.size == next((at for at in log.signed if at > number), number)
        assert shown.believed.name.vehicle == VEHICLE
        assert shown.record is not None
        assert shown.record.seq == number
        assert shown.record.type == json.loads(line)["type"]
        assert shown.signed.seq == shown.checkpoint.size
        assert shown.signed.checkpoint is None
        assert shown.older is None

        assert data.startswith(b"c2sp.org/tlog-proof@v1\nextra " if not last else b"rtshcua/record-proof@v1\n")
        assert proven(data, case.KEYS[Duty.ROOT].kid) == shown


def test_record_is_proven_under_later_checkpoint_or_own_signature(log: SealedLog) -> None:
    for number in (0, 3, log.signed[1], log.signed[2]):
        for at in log.signed:
            made = prove_inclusion(lambda: log.lines, number, at)
            if at < number:
                assert slug(made) == "proof/number"
                continue
            assert proven(proof(made)).checkpoint.size == at
    types = [type(proven(proof(prove_inclusion(lambda: log.lines, at, at))).record) for at in log.signed]
    assert types == [Genesis, Seal, Recover if any(b'"recover"' in line for line in log.lines) else Seal, Close]


def test_the_chain_begins_where_the_log_key_signed_last() -> None:
    sealed, recovered = sealed_log(), sealed_log(recovers=True)
    last = len(sealed.lines) - 2
    for log, count in ((sealed, 3), (recovered, 1)):
        found = find(log.lines, last, None)
        assert not isinstance(found, Flaw)
        assert len(found.chain) - 1 == count


def test_checkpoints_of_one_log_are_consistent(log: SealedLog) -> None:
    for old in log.signed[:-1]:
        for at in (*(at for at in log.signed if at > old), None):
            shown = proven(proof(prove_consistency(lambda: log.lines, old, at)))
            assert shown.kind is ProofKind.CONSISTENCY
            assert shown.older is not None
            assert (shown.older.size, shown.checkpoint.size) == (old, log.signed[-1] if at is None else at)
            assert shown.record is None
    assert slug(prove_consistency(lambda: log.lines, log.signed[-1])) == "proof/number"
    assert slug(prove_consistency(lambda: log.lines, 3)) == "proof/number"
    assert slug(prove_consistency(lambda: log.lines, log.signed[1], 3)) == "proof/number"


def test_unsealed_record_has_no_proof() -> None:
    log = sealed_log(closed=False)
    last = len(log.lines) - 1
    assert slug(prove_inclusion(lambda: log.lines, last)) == "proof/unsealed"
    assert proven(proof(prove_inclusion(lambda: log.lines, log.signed[-1]))).kind is ProofKind.RECORD
    torn = (*log.lines[:-1], log.lines[-1][:-5])
    assert slug(prove_inclusion(lambda: torn, last)) == "proof/number"
    assert proven(proof(prove_inclusion(lambda: torn, 2))).number == 2
    assert slug(prove_inclusion(lambda: log.lines, len(log.lines))) == "proof/number"
    assert slug(prove_inclusion(lambda: (), 0)) == "proof/no-log"


def test_log_truncated_during_proof_is_refused() -> None:
    log = sealed_log()
    for make in (
        lambda lines: prove_inclusion(lines, 3),
        lambda lines: prove_consistency(lines, 6),
        lambda lines: receipt_of(lines, 3, None, kid=LOG_KEY.kid, signer=sign),
    ):
        times = iter((log.lines, log.lines[:3]))
        assert slug(make(lambda times=times: next(times))) == "proof/log"


def test_invalid_log_gives_no_proof() -> None:
    lines = list(sealed_log().lines)
    changed = [*lines[:3], lines[3].replace(b'"token":3', b'"token":4'), *lines[4:]]
    assert slug(prove_inclusion(lambda: changed, 3)) == "proof/path"
    assert slug(prove_inclusion(lambda: changed, 2)) == "proof/path"
    assert slug(prove_consistency(lambda: changed, 6)) == "proof/consistency"
    assert slug(prove_inclusion(lambda: lines[1:], 3)) == "proof/log"
    assert slug(prove_inclusion(lambda: [b"junk\n"], 3)) == "proof/no-log"
    earlier = [lines[0].replace(b'"version":4}', b'"version":3}')]
    assert slug(prove_inclusion(lambda: earlier, 0)) == "genesis/format"
    assert slug(prove_inclusion(lambda: [lines[0], *lines[2:]], 3)) == "proof/log"
    assert slug(prove_inclusion(lambda: [lines[0], lines[0]], 0)) == "proof/log"
    bare = [lines[0].replace(b'"root":"', b'"root":"!'), *lines[1:]]
    assert slug(prove_inclusion(lambda: bare, 3)) == "proof/log"
    other = [lines[0].replace(b'"root":"', b'"root":"AAAA'), *lines[1:]]
    assert slug(prove_inclusion(lambda: other, 3)) == "proof/log"
    seal = [*lines[:6], lines[6].replace(b'"epoch":0', b'"epoch":1'), *lines[7:]]
    assert slug(prove_inclusion(lambda: seal, 3)) == "proof/signed"
    broken = [*lines[:6], lines[6].replace(b'"epoch":0', b'"epoch":-1'), *lines[7:]]
    assert slug(prove_inclusion(lambda: broken, 3)) == "proof/log"


def receipt(log: SealedLog, number: int, at: int | None = None) -> bytes | Flaw:
    return receipt_of(lambda: log.lines, number, at, kid=LOG_KEY.kid, signer=sign)


def test_a_receipt_verifies_alone(log: SealedLog) -> None:
    for number in range(len(log.lines) - 1):
        received = check_receipt(proof(receipt(log, number)), PIN)
        assert isinstance(received, ReceiptClaim), received
        assert received.number == received.record.seq == number
        assert received.name.vehicle == VEHICLE
        assert received.log_key.kid == LOG_KEY.kid
        assert isinstance(received.record, DecisionRecord | Effect | Genesis | Seal | Recover)


def test_invalid_log_or_other_key_gives_no_receipt(log: SealedLog) -> None:
    changed = SealedLog((*log.lines[:3], log.lines[3].replace(b"goto", b"goon"), *log.lines[4:]), log.signed)
    assert slug(receipt(changed, 3)) == slug(receipt(changed, 2)) == "proof/path"
    assert slug(receipt_of(lambda: log.lines, 3, None, kid=bytes(16), signer=sign)) == "trust/log-key"
    assert (
        slug(receipt_of(lambda: log.lines, 3, None, kid=LOG_KEY.kid, signer=lambda _: bytes(64))) == "proof/signature"
    )


def test_receipt_requires_an_inclusion_path(log: SealedLog) -> None:
    assert slug(receipt(log, len(log.lines) - 1)) == "proof/number"
    assert slug(receipt(log, 6, 6)) == "proof/number"
    assert slug(receipt(log, 99)) == "proof/number"
    short = sealed_log(epochs=2, records=0)
    assert slug(receipt(short, 0, 1)) == "proof/number"
    assert isinstance(receipt(short, 0, 2), bytes)
    with pytest.raises(ValueError, match="the path does not lead from leaf"):
        make_receipt(log.lines[0], 0, 1, [], origin="", root=b"", kid=LOG_KEY.kid, signer=sign)
    with pytest.raises(ValueError, match="the path does not lead from leaf"):
        make_receipt(log.lines[0], 1, 1, [bytes(32)], origin="", root=b"", kid=LOG_KEY.kid, signer=sign)
