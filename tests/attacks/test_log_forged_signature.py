"""Threat: the close's signature is removed, or made by another key, or the log is rewritten under another root."""

from base64 import b64decode, b64encode

from reference.forgery import LOG_KEY, as_log_key, edit, expect, flight, prove, read, rewritten, signed, signers
from rtshcua.evidence.report import LogVerdict
from rtshcua.evidence.verify import verify
from rtshcua.wire.keys import Duty, SigningKey
from virtual import case

LINES = flight()
LAST = len(LINES) - 1
STRANGER = SigningKey.from_seed(b"\x77" * 32, duty=Duty.LOG)


def test_stripped() -> None:
    note = read(LINES[-1])["checkpoint"]
    for left in (None, "", note.split("\n\n")[0] + "\n", note.split("\n\n")[0] + "\n\n"):
        assert expect([*LINES[:-1], edit(LINES[-1], checkpoint=left)]) == ("seal/note", LAST)


def test_stripped_with_the_whole_close() -> None:
    assert expect(LINES[:-1]) == ("close/missing", LAST)


def test_signed_by_another_key() -> None:
    assert expect(signed(LINES, STRANGER)) == ("seal/key", 0)


def test_another_key_named_in_the_genesis() -> None:
    """The chain alone is consistent; only the root under the pinned key shows it."""
    forged = signed(as_log_key(LINES, STRANGER), STRANGER)
    assert verify(forged).verdict is LogVerdict.VERIFIED
    assert expect(forged) == ("trust/log-key", 0)


def test_a_key_of_another_duty_named_in_the_genesis() -> None:
    public = case.KEYS[Duty.MISSION].public
    stolen = SigningKey(Duty.LOG, True, case.KEYS[Duty.MISSION].private)
    assert stolen.public == public
    assert expect(signed(as_log_key(LINES, stolen), stolen)) == ("trust/log-key", 0)


def test_the_name_of_the_right_key_beside_another() -> None:
    genesis = edit(LINES[0], log_key=STRANGER.public.hex())
    assert expect(signed([genesis, *LINES[1:]], STRANGER)) == ("genesis/log-key", 0)


def test_a_root_of_the_forgers_own() -> None:
    """Keys, root and log are all new. Only the pin is not."""
    root_key = SigningKey.from_seed(b"\x01\x02" * 16, duty=Duty.ROOT, development=True)
    real, _ = case.root()
    own = type(real)(
        version=1,
        development=True,
        issued_at_us=real.issued_at_us,
        expires_at_us=real.expires_at_us,
        keys=(*(key for key in real.keys if key.duty is not Duty.ROOT), root_key.verification()),
    ).sign(root_key)
    forged = signed([edit(LINES[0], root=b64encode(own).decode()), *LINES[1:]])
    assert verify(forged).verdict is LogVerdict.VERIFIED
    assert expect(forged) == ("trust/root-unknown-key", 0)


def test_a_signature_over_another_log_of_the_same_key() -> None:
    other = signed([edit(LINES[0], boot="11" * 16), *LINES[1:]])
    swapped = edit(LINES[-1], checkpoint=read(other[-1])["checkpoint"])
    assert expect([*LINES[:-1], swapped]) == ("seal/key", LAST)


def test_changed_byte_in_the_signature_is_detected() -> None:
    note = read(LINES[-1])["checkpoint"]
    head, _, encoded = note.rstrip("\n").rpartition(" ")
    data = bytearray(b64decode(encoded))
    data[20] ^= 1
    forged = f"{head} {b64encode(bytes(data)).decode()}\n"
    assert expect([*LINES[:-1], edit(LINES[-1], checkpoint=forged)]) == ("seal/signature", LAST)


def test_the_key_holder_may_rewrite_and_the_report_says_so() -> None:
    """No key proves what its holder wrote first. Effects without a decision can be rewritten: only a witness can show
    it.
    """
    number = next(n for n, line in enumerate(LINES) if read(line).get("event") == "succeeded")
    forged = signed([*LINES[:number], edit(LINES[number], detail="rewritten"), *LINES[number + 1 :]])
    report = prove(forged).report
    assert report.verdict is LogVerdict.VERIFIED
    assert "anchor" in [claim.slug for claim in report.unproven]
    assert LOG_KEY.kid.hex() in next(claim.text for claim in report.proven if claim.slug == "signed-close")


def test_rewritten_without_the_key() -> None:
    changed = [edit(line, detail="rewritten") if read(line).get("event") == "succeeded" else line for line in LINES]
    first = next(number for number, line in enumerate(changed) if line != LINES[number])
    assert expect(rewritten(changed)) == ("seal/root", next(n for n in signers(LINES) if n > first))
