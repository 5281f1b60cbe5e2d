"""Threats to succession: a revoked key continues to sign, and a trust root is accepted that does not follow the
previous one.

The attacker holds keys that were trusted once, including the root's, and every root and bundle that was ever
signed.
"""

import json
from collections.abc import Callable
from dataclasses import replace as altered
from pathlib import Path
from shutil import rmtree
from types import SimpleNamespace
from typing import Any, cast

import pytest
from msgspec.structs import replace

from reference.documents import approval, low, presented, recall, replacement
from reference.flying import context, refusal_of, request
from reference.world import APPROVAL_KEY, LOG_KEY, MISSION_KEY, POLICY_KEY, ROOT, START, VEHICLE, renewed, sealed_again
from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.opened_missions import FileReplayStore, looked_up
from rtshcua.adapters.store.signing import fingerprint, read_link_key
from rtshcua.adapters.store.vehicle_records import RootStore, opened_root
from rtshcua.app.fly import waiting
from rtshcua.app.fly.clearance import revoked_link_key, run_folder
from rtshcua.app.fly.flight_request import FlightContext, FlightRequest
from rtshcua.app.fly.link_signing import LinkSigning
from rtshcua.app.fly.vehicle_trust import trust
from rtshcua.app.fly.verify_bundle import Verified, verify
from rtshcua.app.fly.verify_bundle import lapsed as bundle_lapsed
from rtshcua.app.fly.waiting import admit_bundle, broken_off
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.app import main
from rtshcua.front.cli.console import TerminalConsole
from rtshcua.library import root as library
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, EnforcementMode, Loaded, load
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import TrustRoot
from virtual.policy import POLICY

QUAD = "quad-07"
PATROL = library() / "missions" / "short.rts"


def revoking(*keys: SigningKey) -> TrustRoot:
    """The root after this world's, by which these keys are revoked."""
    names = tuple(key.kid for key in keys)
    return replace(ROOT, version=2, keys=tuple(key for key in ROOT.keys if key.kid not in names), revoked=names)


@pytest.mark.parametrize(
    ("document", "key"), [(approval, APPROVAL_KEY), (recall, APPROVAL_KEY), (replacement, MISSION_KEY)]
)
def test_document_by_revoked_key_is_refused_in_flight(document: Callable[..., bytes], key: SigningKey) -> None:
    of = low()
    assert presented(of, document(of)).slug == "accepted"
    of = renewed(low(), revoking(key))
    assert presented(of, document(of)).slug == "revoked-key"
    of = renewed(low(), revoking(LOG_KEY))
    assert presented(of, document(of)).slug == "accepted"


@pytest.mark.parametrize("key", [POLICY_KEY, MISSION_KEY])
def test_a_bundle_of_a_revoked_key_is_not_loaded(key: SigningKey) -> None:
    found = load(
        sealed_again(low()), root=revoking(key), vehicle=VEHICLE, now=START, mode=EnforcementMode.SOFTWARE,
        flight=bytes(16), session_key=bytes(SESSION_KEY_BYTES), peer_is_own_simulator=True,
    )  # fmt: skip
    assert isinstance(found, Refusal)
    assert found.slug == "revoked-key"


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> KeyStore:
    """A key store, whose first root a vehicle accepted, and a bundle for it."""
    monkeypatch.chdir(tmp_path)
    store = KeyStore(data_folder())
    assert main(["keys", "init"]) == ExitCode.OK
    (tmp_path / "first.trust").write_bytes(store.root())
    assert main(["keys", "accept", "first.trust", "--vehicle", QUAD]) == ExitCode.OK
    assert main(["compile", str(PATROL), "-o", "old.bundle"]) == ExitCode.OK
    capsys.readouterr()
    return store


def version() -> int:
    """Of the root that the vehicle accepted last."""
    kept = RootStore(state_folder(), QUAD).kept()
    assert kept is not None
    return opened_root(kept).version


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The slug of a command's refusal."""
    capsys.readouterr()
    assert main([*words, "--json"]) == ExitCode.UNTRUSTED
    said = json.loads(capsys.readouterr().out)
    slug = said["slug"] if words[0] == "run" else said["error"]["slug"]
    assert isinstance(slug, str)
    return slug


def order(**changed: object) -> FlightRequest:
    return request(**({"bundle": Path("old.bundle"), "data": data_folder(), "state": state_folder()} | changed))


def flying(of: FlightRequest, clock: SystemClock | None = None) -> FlightContext:
    return context(of, clock, console=TerminalConsole("json", data_folder(), None))


def verified(of: FlightRequest, bundle: str, clock: SystemClock | None = None) -> Verified:
    found = verify(flying(of, clock), Path(bundle).read_bytes())
    assert isinstance(found, Verified), found
    return found


def unverified(of: FlightRequest, bundle: str, clock: SystemClock | None = None) -> Refusal:
    return refusal_of(verify(flying(of, clock), Path(bundle).read_bytes()))


def accepts(settled: str | Refusal, text: str) -> bool:
    assert isinstance(settled, str)
    return text in settled


def test_vehicle_accepts_all_missed_roots(fleet: KeyStore, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["replace", "mission-agent"], ["rotate-root"]):
        assert main(["keys", *words]) == ExitCode.OK
    chain = [str(fleet.earlier_path(2)), str(fleet.earlier_path(3)), str(fleet.root_path)]
    accept = ("keys", "accept", "--vehicle", QUAD)
    assert refused(capsys, *accept, chain[-1]) == "root-version-gap"
    assert refused(capsys, *accept, chain[0], chain[-1]) == "root-version-gap"
    assert version() == 1
    assert main([*accept, *chain]) == ExitCode.OK
    assert "version 4 replaces version 1; it revokes 2 more keys" in capsys.readouterr().out
    assert version() == 4
    for older in ("first.trust", *chain[:2]):  # and the key that signed them is revoked since
        assert refused(capsys, *accept, older) == "root-revoked-key"
    assert main([*accept, "first.trust", *chain]) == ExitCode.OK, "the same for every vehicle of a fleet"
    assert refused(capsys, "run", "old.bundle", "--root", "first.trust") == "root-revoked-key"
    assert refused(capsys, "run", "old.bundle", "--root", chain[0]) == "root-revoked-key"
    assert version() == 4


def test_older_bundle_is_refused_after_revocation(fleet: KeyStore, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "replace", "mission-agent"]) == ExitCode.OK
    assert refused(capsys, "run", "old.bundle") == "revoked-key"
    assert not Path("runs").exists()
    assert main(["compile", str(PATROL), "-o", "new.bundle"]) == ExitCode.OK, "the new key has the old one's place"
    _, loaded, trusted, _ = verified(order(), "new.bundle")
    assert (trusted.distrust, trusted.root.version, loaded.vehicle) == (None, 2, QUAD)
    assert accepts(trusted.settle(resumed=False), "version 2 replaces version 1")
    assert version() == 2
    fleet.root_path.write_bytes(Path("first.trust").read_bytes())  # the key store is set back
    assert refused(capsys, "run", "old.bundle") == "revoked-key"
    assert version() == 2


def test_roots_accepted_by_vehicle_meanwhile_count(fleet: KeyStore, capsys: pytest.CaptureFixture[str]) -> None:
    """A run waited, or was slow to begin, while a root came that revokes an agent's key: it takes nothing of that key
    any more, and does not put its own root in the place of the newer one.
    """
    assert main(["keys", "rotate-root", "--days", "30"]) == ExitCode.OK
    clock = SystemClock()
    waits = trust((), data_folder(), state_folder(), QUAD, clock.now().utc_us)
    assert waits.superseded() is None
    assert main(["keys", "revoke", "mission-agent"]) == ExitCode.OK
    roots = [str(path) for path in sorted((data_folder() / "keys").glob("root-*.trust"))]
    assert main(["keys", "accept", *roots, str(fleet.root_path), "--vehicle", QUAD]) == ExitCode.OK
    newest = version()
    assert newest > waits.root.version
    for found in (waits.superseded(), waits.settle(resumed=False)):
        assert refusal_of(found)[::3] == ("root-superseded", ExitCode.UNTRUSTED)
    assert version() == newest
    RootStore(state_folder(), QUAD).path.write_bytes(b"damaged")
    assert refusal_of(waits.superseded()).slug == "root-damaged"


def test_two_roots_of_one_version_are_a_fork(fleet: KeyStore, capsys: pytest.CaptureFixture[str]) -> None:
    key, first = fleet.signing_key(Duty.ROOT), opened_root(fleet.root())
    assert main(["keys", "revoke", "approval-owner-operator"]) == ExitCode.OK
    assert main(["keys", "accept", str(fleet.root_path), "--vehicle", QUAD]) == ExitCode.OK
    Path("fork.trust").write_bytes(replace(first, version=2).sign(key))
    assert refused(capsys, "keys", "accept", "fork.trust", "--vehicle", QUAD) == "root-fork"
    Path("unrevoked.trust").write_bytes(replace(first, version=3).sign(key))
    assert refused(capsys, "keys", "accept", "unrevoked.trust", "--vehicle", QUAD) == "root-unrevoked"
    foreign = SigningKey.from_seed(bytes(32), duty=Duty.ROOT, development=True)
    keys = (*first.keys, foreign.verification())
    Path("foreign.trust").write_bytes(replace(first, version=3, keys=keys).sign(foreign))
    assert refused(capsys, "run", "old.bundle", "--root", "foreign.trust") == "root-unknown-key"
    assert version() == 2


def test_root_signed_by_revoked_root_key_is_refused(fleet: KeyStore, capsys: pytest.CaptureFixture[str]) -> None:
    stolen, first = fleet.signing_key(Duty.ROOT), opened_root(fleet.root())
    assert main(["keys", "rotate-root", "--days", "7"]) == ExitCode.OK
    chain = [str(fleet.earlier_path(2)), str(fleet.root_path)]
    assert main(["keys", "accept", *chain, "--vehicle", QUAD]) == ExitCode.OK
    for number in (3, 4):
        Path("stolen.trust").write_bytes(replace(first, version=number).sign(stolen))
        assert refused(capsys, "keys", "accept", "stolen.trust", "--vehicle", QUAD) == "root-revoked-key"
        assert refused(capsys, "run", "old.bundle", "--root", "stolen.trust") == "root-revoked-key"
    assert version() == 3


def test_revoked_log_key_signs_no_log(fleet: KeyStore, capsys: pytest.CaptureFixture[str]) -> None:
    stolen = fleet.key_path(Duty.LOG).read_bytes()
    assert main(["keys", "replace", "log"]) == ExitCode.OK
    Path("stolen.key").touch(0o600)
    Path("stolen.key").write_bytes(stolen)
    assert refused(capsys, "run", "old.bundle", "--log-key", "stolen.key") == "revoked-key"
    verified(order(), "old.bundle")


@pytest.mark.parametrize("resumed", [False, True])
def test_the_key_of_a_link_is_revoked_by_its_fingerprint(
    fleet: KeyStore, capsys: pytest.CaptureFixture[str], resumed: bool
) -> None:
    assert main(["keys", "link", "link.key"]) == ExitCode.OK
    name = fingerprint(read_link_key(Path("link.key")))
    assert name in capsys.readouterr().out
    assert main(["keys", "revoke", "--link", "link.key"]) == ExitCode.OK
    assert f"{name} link key" in " ".join(capsys.readouterr().out.split())
    root = opened_root(fleet.root())
    signing = LinkSigning(Path("link.key"), POLICY, FrameSession(), Path("state"), SystemClock(), unsigned_radio=True)
    if resumed:
        assert revoked_link_key(signing, root, resumed=True) is None
        assert "brought down anyway" in signing.notes[-1]
    else:
        found = refusal_of(revoked_link_key(signing, root, resumed=False))
        assert name in found.text
        assert (found.code, found.slug) == (ExitCode.UNTRUSTED, "link-key-revoked")
    assert revoked_link_key(signing, opened_root(Path("first.trust").read_bytes()), resumed=False) is None
    signing.close()


@pytest.mark.slow
@pytest.mark.parametrize("what", ["mission-agent", "policy", "log", "damaged", "set-back"])
def test_vehicle_in_flight_lands_after_revocation(fleet: KeyStore, what: str) -> None:
    """A run is killed in the air, a key of its bundle is revoked, and it is started again with the old command line."""
    of = launched(order())
    store = FileReplayStore(order().kept_in, QUAD)
    store.open_once(of.bundle.mission_digest, of.expires_us, 0, of.bundle.policy.name, of.bundle.policy.version)
    old_key, again = fleet.key_path(Duty.LOG).read_bytes(), order()
    if what == "damaged":
        RootStore(state_folder(), QUAD).path.write_bytes(b"{")
    elif what == "set-back":
        assert main(["keys", "revoke", "approval-owner-operator"]) == ExitCode.OK
        assert main(["keys", "accept", str(fleet.root_path), "--vehicle", QUAD]) == ExitCode.OK
        again = order(roots=(Path("first.trust"),))
    else:
        assert main(["keys", "replace", what]) == ExitCode.OK
        assert main(["keys", "accept", str(fleet.root_path), "--vehicle", QUAD]) == ExitCode.OK
        Path("old.key").touch(0o600)
        Path("old.key").write_bytes(old_key)
        again = order(log_key=Path("old.key"))
    _, loaded, trusted, _ = verified(again, "old.bundle")
    assert loaded.bundle.mission_digest == of.bundle.mission_digest
    assert accepts(trusted.settle(resumed=True), "brought down anyway")
    grounded = refusal_of(trusted.settle(resumed=False))
    assert grounded.slug in ("revoked-key", "root-damaged", "root-rollback")
    unverified(altered(again, dry_run=True), "old.bundle")
    store.give_back(of.bundle.mission_digest)
    unverified(again, "old.bundle")  # nothing of it is in the air


def test_vehicle_in_flight_lands_without_state_folder(fleet: KeyStore) -> None:
    """Neither what was accepted nor what was opened can be read then: only the vehicle tells whether it flies."""
    of = launched(order())
    rmtree(state_folder())
    state_folder().touch()
    with pytest.raises(NotADirectoryError):
        looked_up(state_folder(), QUAD, of.bundle.mission_digest, of.expires_us, "bridge_inspection", 7)
    _, loaded, trusted, _ = verified(order(), "old.bundle")
    assert loaded.bundle.mission_digest == of.bundle.mission_digest
    assert accepts(trusted.settle(resumed=True), "the vehicle is brought down anyway")
    assert refusal_of(trusted.settle(resumed=False)).code == ExitCode.INPUT


def test_landing_without_run_folder_keeps_evidence_elsewhere(
    fleet: KeyStore, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    Path("runs").touch()
    with pytest.raises(OSError, match="directory"):
        run_folder(flying(order()), launched(order()), b"bundle", resumed=False)
    run, told = run_folder(flying(order()), launched(order()), b"bundle", resumed=True)
    assert (run.path / "mission.bundle").read_bytes() == b"bundle"
    assert run.path.is_relative_to(tmp_path)
    assert str(run.path) in told
    Path("runs").unlink()
    run, told = run_folder(flying(order()), launched(order()), b"bundle", resumed=True)
    assert (run.path.parent, told) == (Path("runs"), "")


class Late(SystemClock):
    """By this clock it is two years later."""

    def now(self) -> Now:
        now = super().now()
        return Now(now.monotonic_us, now.utc_us + 730 * 86_400_000_000, now.utc_error_us)


def expiring(fleet: KeyStore, duty: Duty) -> None:
    """The next root, in which each key of a duty expires within the year; for duty `root`, the root itself."""
    root, soon = opened_root(fleet.root()), SystemClock().now().utc_us + 86_400_000_000
    keys = tuple(replace(key, expires_us=soon) if key.duty is duty is not Duty.ROOT else key for key in root.keys)
    until = root.expires_at_us if duty is Duty.ROOT else 1 << 60
    newer = replace(root, version=2, keys=keys, expires_at_us=until)
    fleet.root_path.write_bytes(newer.sign(fleet.signing_key(Duty.ROOT)))


@pytest.mark.slow
@pytest.mark.parametrize("accepted", [False, True])
@pytest.mark.parametrize("duty", [Duty.ROOT, Duty.POLICY, Duty.MISSION, Duty.LOG])
def test_vehicle_in_flight_lands_after_expiry(fleet: KeyStore, duty: Duty, accepted: bool) -> None:
    """A run is killed in the air, and started again after the root, or a key of its bundle or log, expired."""
    expiring(fleet, duty)
    bundle = Path("old.bundle").read_bytes()
    if not accepted:
        RootStore(state_folder(), QUAD).path.unlink()
    of = launched(order())
    log_key = fleet.signing_key(Duty.LOG).kid
    assert bundle_lapsed(bundle, fleet.root(), log_key, of, SystemClock()) is None
    lapsed = bundle_lapsed(bundle, fleet.root(), log_key, of, Late())  # by the vehicle's clock, or after a long wait
    assert lapsed is not None
    fresh = unverified(order(), "old.bundle", Late())  # nothing of it flew
    assert fresh.slug == lapsed.slug == ("expired" if duty is Duty.ROOT else "key-expired")
    store = FileReplayStore(order().kept_in, QUAD)
    store.open_once(of.bundle.mission_digest, of.expires_us, 0, of.bundle.policy.name, of.bundle.policy.version)
    _, loaded, trusted, _ = verified(order(), "old.bundle", Late())
    assert loaded.bundle.mission_digest == of.bundle.mission_digest
    assert trusted.distrust is not None
    assert trusted.distrust.slug == fresh.slug
    assert accepts(trusted.settle(resumed=True), "brought down anyway")
    refusal_of(trusted.settle(resumed=False))
    unverified(order(dry_run=True), "old.bundle", Late())


def test_wait_brings_down_only_its_own_flight(fleet: KeyStore, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run died, the vehicle returned otherwise, and later a pilot flies it in a mode that we use too."""
    monkeypatch.setattr(waiting, "BUNDLE", "old.bundle")
    base = launched(order())
    past: Any = SimpleNamespace(broken_off=Path.cwd())
    seen = SimpleNamespace(landed_state=2, airborne=True, armed=True)
    vehicle: Any = SimpleNamespace(driver=SimpleNamespace(seen=seen))

    def found(clock: SystemClock) -> bool:
        aloft = broken_off(flying(order(), clock), past, base, vehicle, [])
        assert not isinstance(aloft, Refusal)
        return aloft is not None

    assert not found(SystemClock()), "nothing of that bundle flew"
    store = FileReplayStore(order().kept_in, QUAD)
    store.open_once(base.bundle.mission_digest, base.expires_us, 0, base.bundle.policy.name, base.bundle.policy.version)
    assert found(SystemClock())
    assert not found(Late())
    seen.airborne = seen.armed = False
    assert not found(SystemClock())


def replace_mission(base: Loaded) -> Loaded:
    """Wait with another mission."""
    flight = SimpleNamespace(flight=base.in_force.flight)
    bundle = SimpleNamespace(policy_digest=base.bundle.policy_digest, mission_digest=b"")
    return cast("Loaded", SimpleNamespace(bundle=bundle, in_force=flight))


def test_bundle_is_refused_after_log_key_expired(fleet: KeyStore) -> None:
    expiring(fleet, Duty.LOG)
    bundle = Path("old.bundle").read_bytes()
    _, base, trusted, signer = verified(order(), "old.bundle")
    other, unsigned = replace_mission(base), cast("LinkSigning", None)
    refusal = refusal_of(admit_bundle(flying(order(), Late()), bundle, other, trusted, signer.kid, unsigned))
    assert (refusal.slug, "the log key" in refusal.text) == ("key-expired", True)


@pytest.mark.parametrize("named", [False, True])
def test_an_expired_root_is_accepted_by_no_vehicle(
    fleet: KeyStore, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, named: bool
) -> None:
    if named:
        RootStore(state_folder(), QUAD).path.unlink()
    later_ns = Late().now().utc_us * 1000
    monkeypatch.setattr("time.time_ns", lambda: later_ns)
    assert refused(capsys, "keys", "accept", "first.trust", "--vehicle", QUAD) == "root-expired"
    assert RootStore(state_folder(), QUAD).path.exists() is not named


def launched(of: FlightRequest) -> Loaded:
    return verified(of, str(of.bundle)).loaded


def test_flight_accepts_production_root_but_not_development_root(tmp_path: Path) -> None:
    key = SigningKey.from_seed(bytes([7]) * 32, duty=Duty.ROOT)
    earnest = TrustRoot(1, False, 0, 1 << 60, (key.verification(),))
    path = tmp_path / "earnest.trust"
    path.write_bytes(earnest.sign(key))
    found = trust((path,), tmp_path, tmp_path, QUAD, 1)
    assert RootStore(tmp_path, QUAD).kept() is None, "not before it flies"
    assert found.settle(resumed=False) == ""
    assert RootStore(tmp_path, QUAD).kept() == path.read_bytes()
    developer = SigningKey.from_seed(bytes([8]) * 32, duty=Duty.ROOT, development=True)
    path.write_bytes(TrustRoot(2, True, 0, 1 << 60, (developer.verification(),)).sign(developer))
    again = trust((path,), tmp_path, tmp_path, QUAD, 1)
    assert again.distrust is not None
    assert again.distrust.slug == "root-unknown-key"
    assert trust((path,), tmp_path, tmp_path / "else", QUAD, 1).keeps is False
