"""The boundary in C signs the checkpoint that begins the log of its flight, as Python does, and nothing else."""

import ctypes
from base64 import b64encode
from hashlib import sha256
from random import Random

import pytest

from boundary.both_boundaries import begin
from reference.flat_case import MISSION
from reference.world import ROOT, ROOT_KEY, SESSION_KEY, START, VEHICLE, sealed
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.log_writer import Recorder, origin_of
from rtshcua.evidence.note import Checkpoint, parse
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.rows import rows

LOG_KEY = case.KEYS[Duty.LOG]
EMPTY = sha256(b"").digest()
SAMPLE, SOAK = 300, 100_000


def held(boundary: ctypes.CDLL) -> tuple[Caller, bytes]:
    """A boundary with a bundle in force, and the id of its flight."""
    caller = begin(boundary, ROOT.sign(ROOT_KEY), ROOT_KEY.verification().public, VEHICLE, SESSION_KEY, START)
    flight = caller.load(sealed(), START)
    assert isinstance(flight, bytes)
    return caller, flight


def begins(flight: bytes, vehicle: str = VEHICLE) -> str:
    return Checkpoint(origin_of(vehicle, flight.hex()), 0, EMPTY, bytes(range(32)), bytes(range(9, 41))).text()


def test_both_sign_the_first_record_of_a_log_alike(boundary: ctypes.CDLL) -> None:
    caller, flight = held(boundary)
    signed: list[tuple[bytes, bytes | Refusal]] = []

    def certify(text: bytes) -> bytes:
        signed.append((text, caller.sign_log(text)))
        return LOG_KEY.sign(text, duty=Duty.LOG)

    Recorder(certify, LOG_KEY.public, lambda: bytes(32)).genesis(
        START, bundle=b"bundle", root=b"root", boot=flight, vehicle=VEHICLE, mission=MISSION.name, mode="process"
    )
    ((text, signature),) = signed
    assert signature == LOG_KEY.sign(text, duty=Duty.LOG)
    again = caller.sign_log(text)
    assert isinstance(again, Refusal), "a flight has one log"
    assert again.slug == "log-begun"


@rows("text", [
    lambda flight: begins(flight[::-1] if flight != flight[::-1] else bytes(16)),
    lambda flight: begins(flight, "quad-08"),
    lambda flight: begins(flight, VEHICLE + "/"),
    lambda flight: begins(flight).replace("\n0\n", "\n1\n"),
    lambda flight: begins(flight).replace("\n0\n", "\n00\n"),
    lambda flight: begins(flight) + f"after {b64encode(bytes(32)).decode()}\n",
    lambda flight: begins(flight).replace("47DE", "47DF"),
    lambda flight: begins(flight) + "\n",
    lambda flight: begins(flight)[:-1],
    lambda flight: "",
    lambda flight: "x" * 60_000,
    lambda flight: begins(flight).partition("key ")[0],
    lambda flight: begins(flight).replace("record ", "record  "),
])  # fmt: skip
def test_text_other_than_a_checkpoint_is_not_signed(text: object, boundary: ctypes.CDLL) -> None:
    caller, flight = held(boundary)
    assert callable(text)
    refused = caller.sign_log(text(flight).encode())
    assert isinstance(refused, Refusal)
    assert refused.slug == "not-its-log"
    assert isinstance(caller.sign_log(begins(flight).encode()), bytes), "and it is none the worse for it"


def test_checkpoint_is_not_signed_before_a_flight(boundary: ctypes.CDLL) -> None:
    caller = begin(boundary, ROOT.sign(ROOT_KEY), ROOT_KEY.verification().public, VEHICLE, SESSION_KEY, START)
    flight = caller.flight()
    assert isinstance(flight, bytes)
    refused = caller.sign_log(begins(flight).encode())
    assert isinstance(refused, Refusal)
    assert refused.slug == "not-loaded"


def compare(boundary: ctypes.CDLL, seed: int) -> bool:
    """Check that a text with changed octets is signed only if Python reads it as the beginning of this log."""
    of = Random(seed)
    caller, flight = held(boundary)
    text = bytearray(begins(flight).encode())
    for _ in range(of.choice((1, 1, 1, 2))):
        at = of.randrange(len(text))
        match of.randrange(3):
            case 0:
                text[at] = of.choice((of.randrange(128), *b"AZaz09+/=\n %"))
            case 1:
                text.insert(at, of.choice(b"A0+/=\n "))
            case _:
                del text[at]
    read = parse(text.decode())
    begun = isinstance(read, Checkpoint) and read._replace(record=b"", key=b"") == Checkpoint(
        origin_of(VEHICLE, flight.hex()), 0, EMPTY, b"", b""
    )
    begun = begun and isinstance(read, Checkpoint) and read.key is not None
    assert isinstance(caller.sign_log(bytes(text)), bytes) == begun, (seed, bytes(text))
    return begun


def test_damaged_note_is_read_alike(boundary: ctypes.CDLL) -> None:
    found = [compare(boundary, seed) for seed in range(SAMPLE)]
    assert 0 < sum(found) < SAMPLE


@pytest.mark.soak
@pytest.mark.parametrize("first", range(SAMPLE, SOAK, 5_000))
def test_damaged_note_is_read_alike_long(first: int, boundary: ctypes.CDLL) -> None:
    for seed in range(first, first + 5_000):
        compare(boundary, seed)
