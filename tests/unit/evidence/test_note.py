"""Signed notes: the published example, a round trip, and every way to be no such note."""

from base64 import b64decode, b64encode

import pytest

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import Checkpoint, key_id, open_note, sign
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey

ORIGIN = "rtshcua/log/quad-07/00"
CHECKPOINT = Checkpoint(ORIGIN, 7, bytes(range(32)))


@pytest.fixture
def key(log_key: SigningKey) -> VerificationKey:
    return log_key.verification()


@pytest.fixture
def note(log_key: SigningKey) -> str:
    return sign(CHECKPOINT, log_key.public, lambda text: log_key.sign(text, duty=Duty.LOG))


def test_text_is_origin_size_and_root() -> None:
    root = b64decode("CsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=")
    text = "example.com/behind-the-sofa\n20852163\nCsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=\n"
    assert Checkpoint("example.com/behind-the-sofa", 20852163, root).text() == text


def test_key_id_of_the_go_checksum_database() -> None:
    """`sum.golang.org+033de0ae+...`, the verifier key that every Go installation carries."""
    public = b64decode("Ac4zctda0e5eza+HJyk9SxEdh+s3Ux18htTTAD8OuAn8")
    assert public[:1] == b"\x01"
    assert key_id("sum.golang.org", public[1:]).hex() == "033de0ae"


def test_round_trip(note: str, key: VerificationKey) -> None:
    assert note.startswith(CHECKPOINT.text() + "\n\u2014 " + ORIGIN + " ")
    assert open_note(note, ORIGIN, key) == CHECKPOINT


def slug(note: str, key: VerificationKey, origin: str = ORIGIN) -> str:
    opened = open_note(note, origin, key)
    assert isinstance(opened, Flaw)
    return opened.slug


def test_no_signature(note: str, key: VerificationKey) -> None:
    assert slug(CHECKPOINT.text(), key) == "close/unsigned"
    assert slug(CHECKPOINT.text() + "\n", key) == "close/unsigned"
    assert slug("", key) == "close/unsigned"


def test_two_signatures(note: str, key: VerificationKey) -> None:
    assert slug(note + note.splitlines()[-1] + "\n", key) == "close/note"


@pytest.mark.parametrize(
    ("old", "new"),
    [("\n\u2014 ", "\n- "), (ORIGIN + " ", ORIGIN + "  "), ("\n\u2014 ", "\n\u2014\u2014 ")],
)
def test_signature_line_of_another_form(old: str, new: str, note: str, key: VerificationKey) -> None:
    head, blank, last = note.rpartition("\n\n")
    assert slug(head + blank[:1] + (blank[1:] + last).replace(old, new, 1), key) in {"close/note", "close/key"}


def test_signature_without_its_newline_or_too_short(note: str, key: VerificationKey) -> None:
    assert slug(note[:-1], key) == "close/note"
    assert slug(note[:-9] + "\n", key) == "close/note"
    assert slug(note[:-9] + "!!!!!!!!\n", key) == "close/note"


def test_spare_bits_of_base64_are_not_free(note: str, key: VerificationKey) -> None:
    """68 bytes end in one `=` and two unused bits: they must be zero."""
    assert note.endswith("=\n")
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
    changed = note[:-3] + letters[letters.index(note[-3]) + 1] + note[-2:]
    assert b64decode(changed.split()[-1]) == b64decode(note.split()[-1])
    assert slug(changed, key) == "close/note"


def test_another_key_or_name(note: str, key: VerificationKey) -> None:
    assert slug(note, SigningKey.from_seed(b"1" * 32, duty=Duty.LOG).verification()) == "close/key"
    assert slug(note, key, "rtshcua/log/quad-08/00") == "close/key"


def test_another_text(note: str, key: VerificationKey) -> None:
    assert slug(note.replace("\n7\n", "\n8\n"), key) == "close/signature"


def test_signature_that_is_not_reduced(note: str, key: VerificationKey) -> None:
    """RFC 8032, section 5.1.7: S + L would verify too, were it not refused."""
    head, _, encoded = note.removesuffix("\n").rpartition(" ")
    data = b64decode(encoded)
    order = 2**252 + 27742317777372353535851937790883648493
    scalar = int.from_bytes(data[36:], "little") + order
    assert slug(f"{head} {b64encode(data[:36] + scalar.to_bytes(32, 'little')).decode()}\n", key) == "close/signature"


@pytest.mark.parametrize(
    "text",
    [
        "one line\n",
        f"{ORIGIN}\n07\n{b64encode(bytes(32)).decode()}\n",
        f"{ORIGIN}\n\u0667\n{b64encode(bytes(32)).decode()}\n",
        f"{ORIGIN}\n{'9' * 5000}\n{b64encode(bytes(32)).decode()}\n",
        f"{ORIGIN}\n7\nno base64\n",
        f"{ORIGIN}\n7\n{b64encode(bytes(32)).decode()}\nextension\n",
    ],
)
def test_signed_text_that_is_no_checkpoint(text: str, log_key: SigningKey) -> None:
    signature = key_id(ORIGIN, log_key.public) + log_key.sign(text.encode(), duty=Duty.LOG)
    note = f"{text}\n\u2014 {ORIGIN} {b64encode(signature).decode()}\n"
    assert slug(note, log_key.verification()) == "close/note"
