"""Proofs whose signatures, keys or checkpoints are not those of the log, and what a holder of every key could forge."""

from base64 import b64decode, b64encode

from reference.proof_parts import (
    LOG,
    OTHER,
    THIEF,
    Parts,
    changed_root,
    consistency,
    inclusion,
    origin,
    receipt_of_record,
    signed,
    slug_of_receipt,
)
from reference.sealed_log import LOG_KEY, now, sealed_log
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.proofs.make import prove_inclusion
from rtshcua.wire import cbor
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import TrustRoot
from virtual import case


def test_a_signature_is_stripped() -> None:
    parts = inclusion(3)
    parts.note = parts.note.rpartition("\n\n")[0] + "\n"
    assert parts.slug() == "proof/note"
    parts.note += "\n"
    assert parts.slug() == "proof/note"


def test_a_signature_is_changed() -> None:
    parts = inclusion(3)
    head, _, encoded = parts.note.rpartition(" ")
    octets = bytearray(b64decode(encoded))
    octets[-1] ^= 1
    parts.note = f"{head} {b64encode(octets).decode()}\n"
    assert parts.slug() == "proof/signature"


def test_the_root_in_a_checkpoint_is_changed() -> None:
    parts = inclusion(3)
    lines = parts.note.split("\n")
    lines[2] = b64encode(bytes(32)).decode()
    parts.note = "\n".join(lines)
    assert parts.slug() == "proof/signature"


def test_a_key_of_the_forgers_own_signs_the_checkpoint() -> None:
    parts = inclusion(3)
    parts.note = signed(parts.note.rpartition("\n\n")[0] + "\n", THIEF, origin(LOG))
    assert parts.slug() == "proof/key"


def test_a_chain_that_begins_with_a_key_of_the_forgers_own() -> None:
    parts = inclusion(3)
    first = parts.extra["chain"][0]
    parts.extra["chain"] = (signed(first.rpartition("\n\n")[0] + "\n", THIEF, origin(LOG)),)
    assert parts.slug() == "trust/log-key"


def test_a_link_of_the_chain_is_missing() -> None:
    parts = inclusion(14)
    assert len(parts.extra["chain"]) == 3
    parts.extra["chain"] = parts.extra["chain"][:1] + parts.extra["chain"][2:]
    assert parts.slug() == "proof/key"
    parts.extra["chain"] = parts.extra["chain"][1:]
    assert parts.slug() == "trust/log-key"
    parts.extra["chain"] = ()
    assert parts.slug() == "trust/log-key"


def test_the_chain_is_out_of_order_or_holds_a_note_twice() -> None:
    parts = inclusion(14)
    first, second, third = parts.extra["chain"]
    parts.extra["chain"] = (first, first, second, third)
    assert parts.slug() == "proof/chain"
    parts.extra["chain"] = (first, third, second)
    assert parts.slug() == "proof/key"


def test_something_after_the_end_of_the_log() -> None:
    parts, close = inclusion(3), inclusion(18)
    parts.extra["chain"] = (*close.extra["chain"], close.note)
    assert parts.slug() == "proof/chain"


def test_a_captured_epoch_key_makes_an_earlier_epoch_anew() -> None:
    """A captured vehicle has the last epoch's key; the first checkpoint was signed by another key."""
    captured = SigningKey.from_seed((3).to_bytes(32), duty=Duty.LOG)  # the third that the recorder drew
    parts = inclusion(3)
    text = parts.note.rpartition("\n\n")[0] + "\n"
    parts.note = signed(text, captured, origin(LOG))
    assert parts.slug() == "proof/key"
    last = inclusion(14)
    assert last.note == signed(last.note.rpartition("\n\n")[0] + "\n", captured, origin(LOG)), "it is that key"


def test_a_log_of_the_forgers_own_under_the_root_of_others() -> None:
    """Everything is valid except the key: the trust root names another one for duty `log`."""
    recorder = Recorder(lambda text: THIEF.sign(text, duty=Duty.LOG), THIEF.public, lambda: bytes(32))
    genesis = recorder.genesis(
        now(0), bundle=b"", root=case.root()[1], boot=bytes(16), vehicle="quad-07", mission="m", mode="software"
    )
    made = prove_inclusion(lambda: [genesis, recorder.seal(now(1))], 0)
    assert isinstance(made, Flaw)
    assert made.slug == "trust/log-key"


def test_a_root_of_the_forgers_own() -> None:
    mine, keys = case.root()[0], dict(case.KEYS)
    keys[Duty.ROOT] = SigningKey.from_seed(bytes([67]) * 32, duty=Duty.ROOT, development=True)
    named = (*(key for key in mine.keys if key.duty is not Duty.ROOT), keys[Duty.ROOT].verification())
    parts = inclusion(3)
    parts.extra["root"] = TrustRoot(1, True, mine.issued_at_us, mine.expires_at_us, named).sign(keys[Duty.ROOT])
    assert parts.slug() == "trust/root-unknown-key"
    parts.extra["root"] = b"junk"
    assert parts.slug() == "trust/root-malformed"


def test_a_log_key_that_had_expired_or_is_for_other_vehicles() -> None:
    for root in (changed_root(expires_us=case.flat.ISSUED), changed_root(vehicles=("quad-08",))):
        parts = inclusion(3)
        parts.extra["root"] = root
        assert parts.slug() == "trust/log-key"
    receipt = cbor.decode(receipt_of_record(3)[1:])
    for root in (changed_root(expires_us=case.flat.ISSUED), changed_root(vehicles=("quad-08",))):
        data = b"\xd2" + cbor.encode((receipt[0], {**receipt[1], "rtshcua/root": root}, *receipt[2:]))  # type: ignore[index,dict-item,misc]
        assert slug_of_receipt(data) == "trust/log-key"


def test_invalid_origin_is_rejected() -> None:
    for name in ("rtshcua/log/quad+7/z", "rtshcua/log/quad 07/" + "0" * 32, "rtshcua/log/x", "other/log/quad/0"):
        parts = inclusion(3)
        parts.extra["chain"] = (signed(f"{name}\n0\n{parts.note.split(chr(10), 2)[2]}", LOG_KEY, name),)
        assert parts.slug() in ("proof/origin", "proof/note")
    for name in ("rtshcua/log/x/y/z", "rtshcua/log/x+y/z"):
        parts = inclusion(3)
        lines = parts.note.split("\n")
        parts.extra["chain"] = (signed("\n".join([name, *lines[1:5], ""]), LOG_KEY, name),)
        assert parts.slug() == "proof/origin"


def test_checkpoints_of_two_logs_in_one_chain() -> None:
    """The log key signed both; in the name of the one it vouches for nothing in the other."""
    parts, other = inclusion(3), inclusion(18, OTHER, at=18)
    parts.extra["chain"] = (*parts.extra["chain"], other.extra["chain"][0])
    assert parts.slug() == "proof/key"
    text = parts.extra["chain"][0].rpartition("\n\n")[0] + "\n"
    mixed = text.replace(origin(LOG), origin(OTHER)).replace("\n0\n", "\n1\n")
    parts.extra["chain"] = (parts.extra["chain"][0], signed(mixed, LOG_KEY, origin(LOG)))
    assert parts.slug() == "proof/chain"


def test_a_record_that_does_not_carry_the_checkpoint() -> None:
    parts = inclusion(3)
    parts.extra["signed"] = parts.extra["signed"].replace(b'"epoch":0', b'"epoch":1')
    assert parts.slug() == "proof/signed"
    parts.extra["signed"] = parts.extra["record"]
    assert parts.slug() == "proof/signed"
    parts.extra["signed"] = LOG.lines[6]
    assert parts.slug() == "proof/signed"
    parts.extra["signed"] = b"{}\n"
    assert parts.slug() == "proof/record"


def test_seal_signed_as_a_recovery_is_refused() -> None:
    """A seal is signed by the key of its epoch: the log key signs geneses and recoveries alone."""
    parts = inclusion(3)
    parts.note = signed(parts.note.rpartition("\n\n")[0] + "\n", LOG_KEY, origin(LOG))
    assert parts.slug() == "proof/signed"


def test_a_split_view_is_not_consistent() -> None:
    """The holder of every key wrote two logs of one boot: their checkpoints do not follow from one another."""
    twin = sealed_log(mission="another")
    ours, theirs = consistency(6), consistency(6, log=twin)
    ours.extra["chain"] = (ours.extra["chain"][0], theirs.extra["chain"][1], *ours.extra["chain"][2:])
    assert ours.slug() == "proof/consistency"


def test_a_consistency_proof_of_other_sizes() -> None:
    parts = consistency(6, 12)
    parts.number = "old 12"
    assert parts.slug() == "proof/chain"
    parts.number = "old 0"
    assert parts.slug() == "proof/consistency"
    parts.number = "old 7"
    assert parts.slug() == "proof/chain"
    parts = consistency(6, 12)
    parts.path = parts.path[1:]
    assert parts.slug() == "proof/consistency"


def test_proof_of_another_kind_is_rejected() -> None:
    kinds = [inclusion(3), consistency(6), inclusion(18)]
    for parts in kinds:
        for other in kinds:
            if other.kind != parts.kind:
                made = Parts(parts.together())
                made.kind = other.kind
                made.number = f"{other.number.split()[0]} {parts.number.split()[1]}"
                assert made.slug() in ("proof/extra", "proof/record", "proof/chain", "proof/consistency")


def test_a_signed_record_in_the_name_of_another() -> None:
    parts = inclusion(18)
    parts.number = "index 17"
    assert parts.slug() == "proof/record"
    parts.number, parts.path = "index 18", inclusion(3).path
    assert parts.slug() == "proof/record"
