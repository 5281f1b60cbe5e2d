"""The basis of a log is refused, one part at a time. Every part is signed by the right key, but wrong."""

from base64 import b64encode

from msgspec.structs import replace

from reference.forgery import LOG_KEY, edit, expect, flight, prove, signed
from rtshcua.wire.keys import Duty, VerificationKey
from virtual import case

LINES = flight()


def with_root(*keys: VerificationKey) -> list[bytes]:
    root, _ = case.root()
    data = replace(root, keys=keys).sign(case.KEYS[Duty.ROOT])
    return [edit(LINES[0], root=b64encode(data).decode()), *LINES[1:]]


def test_log_key_for_another_vehicle_is_refused() -> None:
    root, _ = case.root()
    keys = tuple(replace(key, vehicles=("quad-08",)) if key.duty is Duty.LOG else key for key in root.keys)
    assert expect(signed(with_root(*keys))) == ("trust/log-key", 0)


def test_expired_log_key_is_refused() -> None:
    root, _ = case.root()
    keys = tuple(replace(key, expires_us=1) if key.duty is Duty.LOG else key for key in root.keys)
    assert expect(signed(with_root(*keys))) == ("trust/log-key", 0)


def test_root_without_the_log_key_is_refused() -> None:
    root, _ = case.root()
    keys = tuple(key for key in root.keys if key.kid != LOG_KEY.kid)
    assert expect(signed(with_root(*keys))) == ("trust/log-key", 0)


def test_root_without_the_policy_key_is_refused() -> None:
    root, _ = case.root()
    keys = tuple(key for key in root.keys if key.duty is not Duty.POLICY)
    assert expect(signed(with_root(*keys))) == ("trust/bundle-unknown-key", 0)


def begun_with(bundle: bytes) -> list[bytes]:
    return signed([edit(LINES[0], bundle=b64encode(bundle).decode()), *LINES[1:]])


def test_invalid_policy_is_refused() -> None:
    policy = case.policy()
    broken = replace(policy, contingency=tuple(replace(link, skill=99) for link in policy.contingency))
    assert expect(begun_with(case.seal(case.mission(case.short_steps()), broken))) == ("trust/bundle-malformed", 0)


def test_mission_that_loosens_its_contract_is_refused() -> None:
    first, *others = case.short_steps()
    loose = replace(first, contract=replace(first.contract, require=()))
    assert expect(begun_with(case.seal(case.mission((loose, *others))))) == ("trust/bundle-malformed", 0)


def test_report_distinguishes_trust_root_from_development_root() -> None:
    root, _ = case.root()
    keys = tuple(replace(key, development=False) for key in root.keys)
    data = replace(root, development=False, keys=keys).sign(case.KEYS[Duty.ROOT])
    report = prove(signed([edit(LINES[0], root=b64encode(data).decode()), *LINES[1:]])).report
    assert report.failure is None
    assert report.proven[0].text.startswith("the trust root is signed by the pinned key")
    assert "development" not in [claim.slug for claim in report.unproven]
