"""Cosignatures: the example of c2sp.org/tlog-cosignature, and invalid ones."""

from base64 import b64decode, b64encode
from hashlib import sha256

import pytest

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.witnessing.cosign import Cosignature, cosign, cosignatures, name_of, read_cosignature
from rtshcua.wire.keys import Duty, SigningKey, key_id
from virtual.rows import rows

KEY = SigningKey.from_seed(bytes([7]) * 32, duty=Duty.WITNESS)
OTHER = SigningKey.from_seed(bytes([8]) * 32, duty=Duty.WITNESS)
TEXT = "rtshcua/log/quad/00\n5\nAA==\n"
TIME = 1_679_315_147


def line_of(key: SigningKey = KEY, text: str = TEXT, time_s: int = TIME) -> str:
    return cosign(text, time_s, key.public, lambda data: key.sign(data, duty=Duty.WITNESS))


def test_a_cosignature_as_the_page_says_it() -> None:
    """Built from the text of the page: name, id, time, and the signed message."""
    line = line_of()
    mark, name, encoded = line.split(" ")
    octets = b64decode(encoded)
    assert (mark, name) == ("—", f"rtshcua/witness/{key_id(Duty.WITNESS, KEY.public).hex()}")
    assert octets[:4] == sha256(name.encode() + b"\n\x04" + KEY.public).digest()[:4]
    assert octets[4:12] == TIME.to_bytes(8, "big")
    message = f"cosignature/v1\ntime {TIME}\n{TEXT}".encode()
    assert KEY.verification().verify(octets[12:], message)
    assert len(octets) == 76


def test_cosignature_can_be_read_back() -> None:
    keys = [OTHER.public, KEY.public]
    assert read_cosignature(line_of(), TEXT, keys) == Cosignature(KEY.public, name_of(KEY.public), TIME)
    assert cosignatures(f"{TEXT}\n{line_of()}{line_of(OTHER)}", keys) == (
        TEXT,
        [Cosignature(KEY.public, name_of(KEY.public), TIME), Cosignature(OTHER.public, name_of(OTHER.public), TIME)],
    )


@rows("line", ["", "— a b\n", "— a AAAA\n", line_of()[:-1], line_of(OTHER), "x" + line_of()])
def test_lines_of_others_say_nothing(line: str) -> None:
    assert read_cosignature(line, TEXT, [KEY.public]) is None
    assert cosignatures(f"{TEXT}\n{line_of(OTHER)}", [KEY.public]) == (TEXT, [])


def forged(change: int, value: int) -> str:
    mark, name, encoded = line_of().split(" ")
    octets = bytearray(b64decode(encoded))
    octets[change] = value
    return f"{mark} {name} {b64encode(octets).decode()}\n"


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (forged(12, 0), TEXT),
        (forged(11, 0), TEXT),
        (forged(4, 0xFF), TEXT),
        (line_of(), TEXT.replace("5", "6")),
    ],
)
def test_forged_cosignature_line_is_refused(line: str, text: str) -> None:
    found = read_cosignature(line, text, [KEY.public])
    assert isinstance(found, Flaw)
    assert found.slug == "anchor/signature"
    assert cosignatures(f"{text}\n{line}", [KEY.public]) == found


def test_witness_name_is_not_signed() -> None:
    """The name is not signed; a witness that is not ours has its own."""
    name = "witness.example/w1"
    signature = KEY.sign(f"cosignature/v1\ntime 0\n{TEXT}".encode(), duty=Duty.WITNESS)
    octets = sha256(name.encode() + b"\n\x04" + KEY.public).digest()[:4] + bytes(8) + signature
    line = f"— {name} {b64encode(octets).decode()}\n"
    assert read_cosignature(line, TEXT, [KEY.public]) == Cosignature(KEY.public, name, 0)
