"""`keys link` and `run --signing-key`: the key is stored privately, and used or the run is refused."""

import hashlib
from pathlib import Path

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.flying import context, refusal_of, request
from reference.world import VEHICLE, loaded
from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.store import memory
from rtshcua.adapters.store.signing import LinkStore, read_link_key, write_link_key
from rtshcua.adapters.vehicle import address
from rtshcua.app.fly.clearance import timestamps_lost
from rtshcua.app.fly.connect import sign_link, stranded_signal, unmet
from rtshcua.app.fly.link_signing import LinkSigning
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.mavlink.framing import FLAG_SIGNED, FLAGS
from rtshcua.mavlink.radio import UnsignedRadio
from rtshcua.mavlink.signing import SignedLink, SigningState
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.frames import OURS, FrameSession
from virtual import case
from virtual.policy import POLICY

KEY = bytes(range(32))
AUTOPILOT, ADAPTER = Codec(1, 1), Codec(1, OURS)
HEARTBEAT = AUTOPILOT.pack(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 0, 3))
OWN = ADAPTER.pack(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "link.key"
    write_link_key(path, KEY)
    return path


def test_a_key_is_made_once_and_never_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "made.key"
    assert app.main(["keys", "link", str(path)]) == ExitCode.OK
    key = read_link_key(path)
    assert app.main(["keys", "link", str(path)]) == ExitCode.REFUSED
    assert read_link_key(path) == key
    captured = capsys.readouterr()
    assert key.hex() not in captured.out + captured.err
    assert app.main(["keys", "link", str(tmp_path / "other.key")]) == ExitCode.OK
    assert read_link_key(tmp_path / "other.key") != key


def test_a_key_of_a_passphrase_is_the_ground_stations(tmp_path: Path) -> None:
    words = tmp_path / "words"
    words.write_text("correct horse battery\n")
    words.chmod(0o600)
    assert app.main(["keys", "link", str(tmp_path / "key"), "--passphrase-file", str(words)]) == ExitCode.OK
    assert read_link_key(tmp_path / "key") == hashlib.sha256(b"correct horse battery").digest()
    words.write_text("short")
    assert app.main(["keys", "link", str(tmp_path / "key2"), "--passphrase-file", str(words)]) == ExitCode.USAGE
    assert not (tmp_path / "key2").exists()


def test_sign_options_without_a_key_sign_nothing(tmp_path: Path) -> None:
    of = loaded()
    signing = LinkSigning(None, of.bundle.policy, of.executor.frames, tmp_path, SystemClock(), unsigned_radio=False)
    of.executor.frames.observe(HEARTBEAT)
    assert of.executor.frames.seal(OWN, 0) == OWN
    assert signing.verifier is None
    signing.close()
    assert signing.trouble is None
    assert not list(tmp_path.iterdir())


def test_outbound_frames_are_signed_and_timestamps_kept(tmp_path: Path, key_file: Path) -> None:
    of = loaded()
    signing = LinkSigning(key_file, of.bundle.policy, of.executor.frames, tmp_path, SystemClock(), unsigned_radio=False)
    of.executor.frames.observe(HEARTBEAT)
    sealed = of.executor.frames.seal(OWN, SystemClock().now().monotonic_us)
    assert isinstance(sealed, bytes)
    assert sealed[FLAGS] & FLAG_SIGNED
    assert isinstance(signing.verifier, SignedLink)
    signing.close()
    assert signing.trouble is None
    store = LinkStore(tmp_path, VEHICLE, KEY)
    assert store.load() == signing.verifier.state
    store.close()


@pytest.mark.parametrize("policy", [POLICY, replace(POLICY, signals=())], ids=["reads it", "does not"])
def test_the_radio_may_be_let_in(tmp_path: Path, key_file: Path, policy: Policy) -> None:
    for let_in in (False, True):
        signing = LinkSigning(key_file, policy, FrameSession(), tmp_path, SystemClock(), unsigned_radio=let_in)
        assert isinstance(signing.verifier, UnsignedRadio) == let_in
        assert bool(signing.notes) == (not let_in and policy is POLICY), "who needs it is told"
        signing.close()


@pytest.mark.parametrize("what", ["exposed", "malformed", "damaged", "in-use"])
def test_invalid_link_key_prevents_the_run(tmp_path: Path, key_file: Path, what: str) -> None:
    store = LinkStore(tmp_path, VEHICLE, KEY)
    if what != "in-use":
        store.close()
    if what == "exposed":
        key_file.chmod(0o644)
    elif what == "malformed":
        key_file.write_bytes(b"no key")
    elif what == "damaged":
        store.path.write_bytes(b"{")
    signing = sign_link(context(request(signing_key=key_file, state=tmp_path)), loaded())
    refused = refusal_of(timestamps_lost(signing, resumed=False) if isinstance(signing, LinkSigning) else signing)
    code = ExitCode.INPUT if what == "malformed" else ExitCode.UNTRUSTED
    assert (refused.code, refused.slug) == (code, f"link-key-{what}")
    if what == "in-use":
        store.close()
    if what == "damaged":
        LinkStore(tmp_path, VEHICLE, KEY).close()  # it was released


@pytest.mark.parametrize(
    ("link", "told"), [(None, False), ("udpin:127.0.0.1:14550", False), ("udpin:0.0.0.0:14550", True)]
)
def test_unsigned_reachable_link_is_reported(tmp_path: Path, link: str | None, told: bool) -> None:
    at = None if link is None else address.parse(link)
    signing = sign_link(context(request(state=tmp_path, link=at)), loaded())
    assert isinstance(signing, LinkSigning)
    assert any("impersonate the vehicle" in note for note in signing.notes) == told


def test_letting_the_radio_in_goes_with_a_key(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["run", str(tmp_path / "b"), "--unsigned-radio"]) == ExitCode.USAGE
    assert "--signing-key" in capsys.readouterr().err


def test_frames_signed_by_another_key_are_reported(tmp_path: Path, key_file: Path) -> None:
    clock = SystemClock()
    signing = LinkSigning(key_file, POLICY, FrameSession(), tmp_path, clock, unsigned_radio=False)
    now = clock.now()
    link, other = signing.verifier, SignedLink(bytes(range(1, 33)), SigningState(0, {}), now.utc_us, now.monotonic_us)
    assert isinstance(link, SignedLink)
    assert signing.rejected is None, "nothing came"
    link.accept(HEARTBEAT, now.monotonic_us)
    assert signing.rejected == "frames arrive, but none is accepted: 1 not signed"
    link.accept(other.sign(HEARTBEAT, now.monotonic_us), now.monotonic_us)
    assert "1 signed with another key, 1 not signed" in (signing.rejected or "")
    _, text, help, _ = unmet("a vehicle", 10, None, signing.rejected, "nothing else matters then")
    assert text.startswith("no heartbeat from a vehicle within 10 s: frames arrive")
    assert "--signing-key" in help
    right = SignedLink(KEY, SigningState(0, {}), now.utc_us, now.monotonic_us, link=1)
    assert link.accept(right.sign(HEARTBEAT, now.monotonic_us), now.monotonic_us)
    assert signing.rejected is None
    signing.close()


@pytest.mark.parametrize(("let_in", "dry", "flies"), [(False, False, False), (False, True, True), (True, False, True)])
def test_a_mission_that_would_wait_for_the_radio_in_vain_does_not_begin(
    tmp_path: Path, key_file: Path, let_in: bool, dry: bool, flies: bool
) -> None:
    of = loaded(case.policy(), case.mission(case.short_steps()))
    frames = of.executor.frames
    signing = LinkSigning(key_file, of.bundle.policy, frames, tmp_path, SystemClock(), unsigned_radio=let_in)
    found = stranded_signal(request(dry_run=dry), of, signing)
    if flies:
        assert found is None
    else:
        refused = refusal_of(found)
        assert (refused.code, refused.slug) == (ExitCode.REFUSED, "signal-unsigned")
        assert "RADIO_STATUS" in refused.text
        assert "--unsigned-radio" in refused.help
    signing.close()


def test_foreign_state_folder_is_reported_at_the_start(
    tmp_path: Path, key_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "_FOLDER", tmp_path)
    signing = LinkSigning(key_file, POLICY, FrameSession(), tmp_path, SystemClock(), unsigned_radio=False)
    signing.close()
    assert not any("own file" in note for note in signing.notes)
    store = LinkStore(tmp_path, POLICY.vehicle.identity, KEY)
    there = memory.memory_file(store.heard._name)
    store.close()
    there.symlink_to(tmp_path / "elsewhere")
    signing = LinkSigning(key_file, POLICY, FrameSession(), tmp_path, SystemClock(), unsigned_radio=False)
    signing.close()
    assert [note for note in signing.notes if "own file" in note and str(there) in note]
