"""Signed notes: the published example, a round trip, and every kind of invalid note."""

from base64 import b64decode, b64encode
from hashlib import sha256

import pytest

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import Checkpoint, key_id, open_note, read_signature, sign, split
from rtshcua.wire.keys import Duty, SigningKey

ORIGIN = "rtshcua/log/quad-07/00"
CHECKPOINT = Checkpoint(ORIGIN, 7, bytes(range(32)), bytes(range(1, 33)), bytes(range(2, 34)))
LAST = CHECKPOINT._replace(key=None)


@pytest.fixture
def key(log_key: SigningKey) -> bytes:
    return log_key.public


@pytest.fixture
def note(log_key: SigningKey) -> str:
    return sign(CHECKPOINT, log_key.public, lambda text: log_key.sign(text, duty=Duty.LOG))


def test_text_begins_with_origin_size_and_root() -> None:
    """The published example, with our additional lines."""
    root = b64decode("CsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=")
    text = "example.com/behind-the-sofa\n20852163\nCsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=\n"
    checkpoint = Checkpoint("example.com/behind-the-sofa", 20852163, root, bytes(32), bytes(32))
    zeros = "A" * 43 + "="
    assert checkpoint.text() == f"{text}record {zeros}\nkey {zeros}\n"
    assert checkpoint._replace(key=None).text() == f"{text}record {zeros}\n"
    after = checkpoint._replace(after=bytes(32))
    assert after.text() == f"{text}record {zeros}\nkey {zeros}\nafter {zeros}\n"
    assert after._replace(key=None).text() == f"{text}record {zeros}\nafter {zeros}\n"
    assert after.digest() == sha256(after.text().encode()).digest()


def test_key_id_of_the_go_checksum_database() -> None:
    """`sum.golang.org+033de0ae+...`, the verifier key that every Go installation carries."""
    public = b64decode("Ac4zctda0e5eza+HJyk9SxEdh+s3Ux18htTTAD8OuAn8")
    assert public[:1] == b"\x01"
    assert key_id("sum.golang.org", public[1:]).hex() == "033de0ae"


def test_round_trip(note: str, key: bytes) -> None:
    assert note.startswith(CHECKPOINT.text() + "\n\u2014 " + ORIGIN + " ")
    assert open_note(note, ORIGIN, key) == CHECKPOINT


def test_the_last_checkpoint_names_no_key(log_key: SigningKey) -> None:
    note = sign(LAST, log_key.public, lambda text: log_key.sign(text, duty=Duty.LOG))
    assert open_note(note, ORIGIN, log_key.public) == LAST


def test_a_note_is_text_and_signature_lines(note: str) -> None:
    text, lines = split(note + "\u2014 someone AAAAAAAA\n")
    assert text == CHECKPOINT.text()
    assert read_signature(lines[0])[0] == ORIGIN
    assert read_signature(lines[1]) == ("someone", bytes(6))
    assert read_signature("\u2014 AAAA\n") == ("", b"")


def slug(note: str, key: bytes, origin: str = ORIGIN) -> str:
    opened = open_note(note, origin, key)
    assert isinstance(opened, Flaw)
    return opened.slug


def test_no_signature(note: str, key: bytes) -> None:
    assert slug(CHECKPOINT.text(), key) == "note/unsigned"
    assert slug(CHECKPOINT.text() + "\n", key) == "note/unsigned"
    assert slug("", key) == "note/unsigned"


def test_two_signatures(note: str, key: bytes) -> None:
    assert slug(note + note.splitlines()[-1] + "\n", key) == "note/malformed"


@pytest.mark.parametrize(
    ("old", "new"),
    [("\n\u2014 ", "\n- "), (ORIGIN + " ", ORIGIN + "  "), ("\n\u2014 ", "\n\u2014\u2014 ")],
)
def test_signature_line_of_another_form(old: str, new: str, note: str, key: bytes) -> None:
    head, blank, last = note.rpartition("\n\n")
    assert slug(head + blank[:1] + (blank[1:] + last).replace(old, new, 1), key) in {"note/malformed", "note/key"}


def test_signature_without_its_newline_or_too_short(note: str, key: bytes) -> None:
    assert slug(note[:-1], key) == "note/unsigned"
    assert slug(note[:-9] + "\n", key) == "note/malformed"
    assert slug(note[:-9] + "!!!!!!!!\n", key) == "note/malformed"


def test_spare_bits_of_base64_are_not_free(note: str, key: bytes) -> None:
    """68 bytes end in one `=` and two unused bits, which must be zero."""
    assert note.endswith("=\n")
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
    changed = note[:-3] + letters[letters.index(note[-3]) + 1] + note[-2:]
    assert b64decode(changed.split()[-1]) == b64decode(note.split()[-1])
    assert slug(changed, key) == "note/malformed"


def test_another_key_or_name(note: str, key: bytes) -> None:
    assert slug(note, SigningKey.from_seed(b"1" * 32, duty=Duty.LOG).public) == "note/key"
    assert slug(note, key, "rtshcua/log/quad-08/00") == "note/key"


def test_another_text(note: str, key: bytes) -> None:
    assert slug(note.replace("\n7\n", "\n8\n"), key) == "note/signature"


def test_signature_that_is_not_reduced(note: str, key: bytes) -> None:
    """RFC 8032, section 5.1.7: S + L would verify too, were it not refused."""
    head, _, encoded = note.removesuffix("\n").rpartition(" ")
    data = b64decode(encoded)
    order = 2**252 + 27742317777372353535851937790883648493
    scalar = int.from_bytes(data[36:], "little") + order
    assert slug(f"{head} {b64encode(data[:36] + scalar.to_bytes(32, 'little')).decode()}\n", key) == "note/signature"


ZEROS = b64encode(bytes(32)).decode()
GOOD = f"{ORIGIN}\n7\n{ZEROS}\nrecord {ZEROS}\nkey {ZEROS}\n"


@pytest.mark.parametrize(
    "text",
    [
        "one line\n",
        GOOD.replace("\n7\n", "\n07\n"),
        GOOD.replace("\n7\n", "\n\u0667\n"),
        GOOD.replace("\n7\n", f"\n{'9' * 5000}\n"),
        GOOD.replace(ZEROS, "no base64"),
        GOOD.replace(ZEROS, "AAAA", 1),
        GOOD.replace("record", "recold"),
        GOOD.replace("key", "kex"),
        GOOD.replace(f"record {ZEROS}\n", ""),
        GOOD.replace(f"key {ZEROS}", "key AAAA"),
        GOOD.replace(f"key {ZEROS}", "key "),
        GOOD + "extension\n",
        GOOD + "after \n",
        GOOD + "after AAAA\n",
        GOOD + f"after {ZEROS}\nafter {ZEROS}\n",
        GOOD.replace("key", f"after {ZEROS}\nkey"),
    ],
)
def test_signed_text_other_than_a_checkpoint_is_malformed(text: str, log_key: SigningKey) -> None:
    signature = key_id(ORIGIN, log_key.public) + log_key.sign(text.encode(), duty=Duty.LOG)
    note = f"{text}\n\u2014 {ORIGIN} {b64encode(signature).decode()}\n"
    assert slug(note, log_key.public) == "note/malformed"
