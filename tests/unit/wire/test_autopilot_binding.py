"""Autopilot bindings: signed by the log key, for one log of one vehicle, and consistent."""

from typing import Any

import pytest
from msgspec.structs import replace

from rtshcua.wire import artefact, cose, names
from rtshcua.wire.autopilot_binding import (
    MAX_AUTOPILOT_BINDING,
    MAX_DEVIATIONS,
    AutopilotBinding,
    BoundDeviation,
    open_autopilot_binding,
    sign_autopilot_binding,
)
from rtshcua.wire.keys import ANY, Duty, SigningKey, WrongDuty
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted
from virtual.rows import rows

LOG = SigningKey.from_seed(bytes([1]) * 32, duty=Duty.LOG, development=True)
POLICY = SigningKey.from_seed(bytes([2]) * 32, duty=Duty.POLICY, development=True)
APART = BoundDeviation(5_000_000, 8_000_000, 31, 1_500, 20)
BINDING = AutopilotBinding(
    vehicle="quad-07", flight=bytes(16), genesis=bytes(32), records=94, root=bytes([5]) * 32, closed=True,
    file="log_1.ulg", digest=bytes([7]) * 32, size=1_000, kind="ulog", condition="whole",
    source="vehicle_global_position", clock="telemetry", offset_us=-40_000_000, error_us=20_000, utc_apart_us=-3_000,
    points=201, compared=200, agreed=169, horizontal=1_500, vertical=20, flown_us=20_000_000, covered_us=19_900_000,
    deviations=(APART,), others=0, release="0.1", issued_at_us=1_000,
)  # fmt: skip


def root(**about: Any) -> TrustRoot:
    log = LOG.verification(**{"vehicles": (ANY,), **about})
    return TrustRoot(1, True, 0, 1 << 60, (log, POLICY.verification(vehicles=(ANY,))))


def slug(document: bytes, trusted: TrustRoot | None = None, vehicle: str = "quad-07") -> str:
    with pytest.raises(Untrusted) as refused:
        open_autopilot_binding(document, root=trusted or root(), vehicle=vehicle)
    return refused.value.slug


def test_signed_binding_opens() -> None:
    assert open_autopilot_binding(sign_autopilot_binding(BINDING, LOG), root=root(), vehicle="quad-07") == BINDING
    unknown = replace(BINDING, utc_apart_us=None, deviations=())
    assert open_autopilot_binding(sign_autopilot_binding(unknown, LOG), root=root(), vehicle="quad-07") == unknown


def test_binding_needs_the_log_key() -> None:
    with pytest.raises(WrongDuty):
        sign_autopilot_binding(BINDING, POLICY)
    other = SigningKey.from_seed(bytes([9]) * 32, duty=Duty.LOG, development=True)
    assert slug(sign_autopilot_binding(BINDING, other)) == "unknown-key"
    changed = bytearray(sign_autopilot_binding(BINDING, LOG))
    changed[-70] ^= 1
    assert slug(bytes(changed)) in ("bad-signature", "malformed")


def test_key_was_valid_for_the_vehicle_at_the_time_of_issue() -> None:
    signed = sign_autopilot_binding(BINDING, LOG)
    assert slug(signed, vehicle="quad-08") == "wrong-vehicle"
    assert slug(signed, root(vehicles=("quad-08",))) == "wrong-vehicle"
    assert slug(signed, root(expires_us=1_000)) == "key-expired"
    assert open_autopilot_binding(signed, root=root(expires_us=1_001), vehicle="quad-07") == BINDING


def test_other_artefact_of_the_log_key_is_refused() -> None:
    payload = artefact.pack(names.AUTOPILOT_BINDING, BINDING)
    other = cose.sign1(payload, key=LOG, duty=Duty.LOG, content_type=names.QUALIFICATION.content_type)
    assert slug(other) == "wrong-content-type"
    assert slug(bytes(MAX_AUTOPILOT_BINDING + 1)) == "malformed"


@rows(
    "change",
    [
        {"flight": bytes(15)},
        {"digest": bytes(31)},
        {"genesis": b""},
        {"root": bytes(33)},
        {"records": -1},
        {"size": -1},
        {"error_us": -1},
        {"issued_at_us": 1 << 53},
        {"offset_us": -1 << 53},
        {"utc_apart_us": 1 << 53},
        {"agreed": 201},
        {"compared": 202},
        {"agreed": -1},
        {"covered_us": 20_000_001},
        {"covered_us": -1},
        {"file": ""},
        {"file": "x" * 256},
        {"file": "../log.ulg"},
        {"deviations": (APART,) * (MAX_DEVIATIONS + 1)},
        {"deviations": (replace(APART, to_us=0),)},
        {"kind": "csv"},
        {"condition": ""},
        {"clock": "guess"},
    ],
)
def test_binding_that_contradicts_itself(change: dict[str, Any]) -> None:
    assert slug(sign_autopilot_binding(replace(BINDING, **change), LOG)) == "malformed"
