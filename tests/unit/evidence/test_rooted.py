"""The trust in a log: its trust root under the pinned key, and the duty of its log key under that root."""

from base64 import b64encode

import pytest
from msgspec.structs import replace

from reference.forgery import LOG_KEY, ROOT_KEY, flight
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import octets
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Genesis
from rtshcua.evidence.rooted import rooted
from rtshcua.wire.keys import Duty, key_id
from rtshcua.wire.trust import TrustRoot
from virtual import case


@pytest.fixture
def genesis() -> Genesis:
    record = read(flight()[0])
    assert isinstance(record, Genesis)
    return record


def slug(genesis: Genesis, pinned: bytes = ROOT_KEY) -> str:
    found = rooted(genesis, pinned)
    assert isinstance(found, Flaw)
    return found.slug


def test_a_root_that_the_pinned_key_signed(genesis: Genesis) -> None:
    for pinned in (ROOT_KEY, key_id(Duty.ROOT, ROOT_KEY)):
        found = rooted(genesis, pinned)
        assert isinstance(found, TrustRoot)
        assert LOG_KEY.kid in found.keys_for(Duty.LOG)


def test_another_root(genesis: Genesis) -> None:
    assert slug(genesis, bytes(32)) == "trust/root-unknown-key"
    assert slug(replace(genesis, utc_us=genesis.utc_us + 2 * case.YEAR_US)) == "trust/root-expired"


def test_invalid_base64_is_refused(genesis: Genesis) -> None:
    assert slug(replace(genesis, root=genesis.root[:-1])) == "genesis/base64"
    assert slug(replace(genesis, bundle="====")) == "genesis/base64"
    assert octets("AA==") == b"\0"
    assert octets("AB==") is None  # its unused bits are not zero


def test_a_log_key_without_the_duty(genesis: Genesis) -> None:
    mission = case.KEYS[Duty.MISSION]
    assert slug(replace(genesis, log_kid=mission.kid.hex())) == "trust/log-key"
    found = rooted(replace(genesis, log_kid="00" * 16), ROOT_KEY)
    assert isinstance(found, Flaw)
    assert found.expected == LOG_KEY.kid.hex()


def test_a_log_key_of_other_vehicles(genesis: Genesis) -> None:
    keys = tuple(replace(key, vehicles=("another",)) if key.duty is Duty.LOG else key for key in case.root()[0].keys)
    root = replace(case.root()[0], keys=keys).sign(case.KEYS[Duty.ROOT])
    found = rooted(replace(genesis, root=b64encode(root).decode()), ROOT_KEY)
    assert isinstance(found, Flaw)
    assert found.text.endswith("wrong-vehicle")
