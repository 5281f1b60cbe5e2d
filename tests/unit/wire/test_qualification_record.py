"""Qualification records: signed by the log key, for one vehicle, and compared with its present state."""

from typing import Any

import pytest
from msgspec.structs import replace

from rtshcua.wire import cose, names
from rtshcua.wire.keys import ANY, Duty, SigningKey, WrongDuty
from rtshcua.wire.qualification import (
    MAX_QUALIFICATION,
    CheckOutcome,
    Firmware,
    Qualification,
    QualificationCheck,
    open_qualification,
    parameters_digest,
    sign_qualification,
)
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted
from virtual.rows import rows

LOG = SigningKey.from_seed(bytes([1]) * 32, duty=Duty.LOG, development=True)
POLICY = SigningKey.from_seed(bytes([2]) * 32, duty=Duty.POLICY, development=True)
PARAMETERS = (("GF_ACTION", b"\x40" + bytes(7)), ("RTL_RETURN_ALT", b"\x40\x3e" + bytes(6)))
PX4 = Firmware("px4", 0x01100000, bytes.fromhex("0a1b2c3d") + bytes(4))
HELD = QualificationCheck("stop/fly", CheckOutcome.HELD, "within 12.0 m", "8.0 m", 12_000, 8_000, "mm")
FAILED = QualificationCheck("fence/on", CheckOutcome.FAILED, "1", "0")
TOLD = QualificationCheck("settings/nav_dll_act", CheckOutcome.TOLD, "", "nothing")
RECORD = Qualification(
    "quad-07", PX4, PARAMETERS, parameters_digest(PARAMETERS), bytes(32), "", "0.1", 1_000, 60_000_000, ("ab",), (HELD,)
)


def root(**about: Any) -> TrustRoot:
    log = LOG.verification(**{"vehicles": (ANY,), **about})
    return TrustRoot(1, True, 0, 1 << 60, (log, POLICY.verification(vehicles=(ANY,))))


def slug(document: bytes, trusted: TrustRoot | None = None, vehicle: str = "quad-07", now_us: int = 1_000) -> str:
    with pytest.raises(Untrusted) as refused:
        open_qualification(document, root=trusted or root(), vehicle=vehicle, now_us=now_us)
    return refused.value.slug


def test_signed_record_opens() -> None:
    signed = sign_qualification(RECORD, LOG)
    assert open_qualification(signed, root=root(), vehicle="quad-07", now_us=1_000) == RECORD


def test_qualification_record_needs_the_log_key() -> None:
    with pytest.raises(WrongDuty):
        sign_qualification(RECORD, POLICY)
    other = SigningKey.from_seed(bytes([9]) * 32, duty=Duty.LOG, development=True)
    assert slug(sign_qualification(RECORD, other)) == "unknown-key"


def test_qualification_record_needs_a_key_valid_for_its_vehicle() -> None:
    signed = sign_qualification(RECORD, LOG)
    assert slug(signed, vehicle="quad-08") == "wrong-vehicle"
    assert slug(signed, root(vehicles=("quad-08",))) == "wrong-vehicle"
    assert slug(signed, root(expires_us=1_000)) == "key-expired"
    assert open_qualification(signed, root=root(expires_us=1_001), vehicle="quad-07", now_us=1_000) == RECORD


def test_a_key_that_has_expired_may_not_write_an_earlier_time() -> None:
    assert slug(sign_qualification(RECORD, LOG), root(expires_us=1_001), now_us=1_001) == "key-expired"


def test_other_artefact_of_log_key_is_refused() -> None:
    assert slug(cose.sign1(b"", key=LOG, duty=Duty.LOG, content_type=names.PROOF.content_type)) == "wrong-content-type"
    assert slug(bytes(MAX_QUALIFICATION + 1)) == "too-large"


@rows(
    "change",
    [
        {"digest": bytes(32)},
        {"firmware": Firmware("px4", -1, b"")},
        {"firmware": Firmware("px4", 1 << 32, b"")},
        {"issued_at_us": 253_402_300_800_000_000},
        {"checks": (replace(HELD, outcome=4),)},
    ],
)
def test_contradictory_qualification_record_is_refused(change: dict[str, Any]) -> None:
    assert slug(sign_qualification(replace(RECORD, **change), LOG)) == "malformed"


def test_record_qualifies_if_all_checks_passed() -> None:
    assert RECORD.qualifies
    assert replace(RECORD, checks=(HELD, TOLD)).qualifies
    assert not replace(RECORD, checks=(TOLD,)).qualifies
    mixed = replace(RECORD, checks=(HELD, FAILED))
    assert not mixed.qualifies
    assert mixed.failed == (FAILED,)


def test_changes_since_record_are_listed() -> None:
    assert RECORD.changes(PX4, dict(PARAMETERS)) == ()
    assert RECORD.changes(None, {}) == ()
    assert RECORD.changes(PX4, {"GF_ACTION": bytes(8)}) == ("parameters `GF_ACTION`",)
    assert RECORD.changes(PX4, {"NEW": bytes(8), "GF_ACTION": bytes(8)}) == ("parameters `GF_ACTION`, `NEW`",)
    other = Firmware("px4", 0x01110000, bytes(8))
    assert RECORD.changes(other, {}) == ("its firmware is px4 1.17.0, and was px4 1.16.0 (build 0a1b2c3d)",)
