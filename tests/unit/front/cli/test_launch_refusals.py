"""Refusals of `run` between loading a bundle and flying it."""

import os
import shutil
from errno import ENOSPC
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from msgspec.structs import replace

from reference.flat_case import MISSION, POLICY
from reference.flying import context, refusal_of, request
from reference.world import START, VEHICLE, loaded
from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.store import opened_missions as replay
from rtshcua.adapters.store.opened_missions import FileReplayStore
from rtshcua.adapters.store.signing import LinkStore, write_link_key
from rtshcua.adapters.store.vehicle_records import OwedParameters
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.app.fly import replay_check
from rtshcua.app.fly.clearance import hanging, timestamps_lost
from rtshcua.app.fly.connect import make_driver, sign_link
from rtshcua.app.fly.link_signing import LinkSigning
from rtshcua.app.fly.previous_log import LogBefore
from rtshcua.app.fly.verify_bundle import may_have_flown, not_begun
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.options.flight_options import settings_of
from rtshcua.mavlink.signing import SignedLink
from rtshcua.model.flat.signal import SignalSource
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.onboard.enforcement.preparation import Owed

LATER = 1 << 52  # us
START_CLOCK: Any = SimpleNamespace(now=lambda: START)


def test_older_policy_version_is_refused(tmp_path: Path) -> None:
    FileReplayStore(tmp_path, VEHICLE).open_once(bytes(32), LATER, 0, POLICY.name, POLICY.version + 1)
    refused = refusal_of(replay_check.broke_off(tmp_path, loaded(), cast("Any", None), SystemClock(), []))
    assert "already flown under a later version of `bridge_inspection` than 7" in refused.text
    assert (refused.code, refused.slug) == (ExitCode.REFUSED, "old-policy")


@pytest.mark.parametrize(
    ("armed", "landed_state", "resumes"),
    [(False, 1, False), (True, 1, True), (True, 2, True), (True, 0, True), (False, 0, False)],
)
def test_opened_bundle_resumes_while_the_vehicle_may_fly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, armed: bool, landed_state: int, resumes: bool
) -> None:
    """An armed vehicle on the ground may have a takeoff command from a killed run."""
    monkeypatch.setattr(replay_check, "AIR_S", 0.01)
    of = loaded()
    replay_check.mark_opened(tmp_path, of, SystemClock(), cast("Any", Grounded()))
    seen = ObservedVehicle(armed=armed, landed_state=landed_state)
    vehicle: Any = SimpleNamespace(driver=SimpleNamespace(seen=seen), poll=lambda *_: [])
    if resumes:
        assert replay_check.broke_off(tmp_path, of, vehicle, SystemClock(), []) is True
        return
    refused = refusal_of(replay_check.broke_off(tmp_path, of, vehicle, SystemClock(), []))
    assert (refused.code, refused.slug) == (ExitCode.REFUSED, "replayed")


@pytest.mark.parametrize("damage", ["empty", "no-versions", "pipe", "no-folder", "gone", "full"])
@pytest.mark.parametrize("armed", [False, True])
def test_airborne_vehicle_is_landed_whatever_the_state_folder_holds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damage: str, armed: bool
) -> None:
    monkeypatch.setattr(replay_check, "AIR_S", 0.01)
    folder = FileReplayStore(tmp_path, VEHICLE).folder
    if damage == "empty":
        (folder / "floor").touch()
    elif damage == "no-versions":
        (folder / "floor-policies").write_bytes(b"[]")
    elif damage == "pipe":
        os.mkfifo(folder / "floor")
    elif damage == "full":
        monkeypatch.setattr(replay, "write_new", full)
    else:
        folder.rmdir()
        if damage == "gone":  # and cannot be made again
            folder.parent.rmdir()
            folder = folder.parent
        folder.touch()
    seen = ObservedVehicle(armed=armed, landed_state=2 if armed else 1)
    vehicle: Any = SimpleNamespace(driver=SimpleNamespace(seen=seen), poll=lambda *_: [])
    if armed:
        assert replay_check.broke_off(tmp_path, loaded(), vehicle, SystemClock(), []) is True
        return
    if damage not in ("empty", "no-versions"):
        with pytest.raises(OSError):
            replay_check.broke_off(tmp_path, loaded(), vehicle, SystemClock(), [])
        return
    refused = refusal_of(replay_check.broke_off(tmp_path, loaded(), vehicle, SystemClock(), []))
    assert (refused.code, refused.slug) == (ExitCode.REFUSED, "damaged")
    flight = Grounded()
    again = replay_check.mark_opened(tmp_path, loaded(), SystemClock(), cast("Any", flight))
    assert "damaged" in refusal_of(again).text
    assert flight.refused


def full(path: Path, *_: object, **__: object) -> None:
    raise OSError(ENOSPC, "no space left on device", str(path))


def test_writability_check_leaves_no_file(tmp_path: Path) -> None:
    store = FileReplayStore(tmp_path, VEHICLE)
    store.expect_room()
    assert [*store.folder.iterdir()] == []


@pytest.mark.parametrize("damage", ["damaged", "no-folder"])
@pytest.mark.parametrize("resumed", [False, True])
def test_unknown_link_timestamps_bring_an_airborne_vehicle_home(tmp_path: Path, damage: str, resumed: bool) -> None:
    key_file = tmp_path / "link.key"
    write_link_key(key_file, bytes(range(32)))
    store = LinkStore(tmp_path, VEHICLE, bytes(range(32)))
    store.close()
    if damage == "damaged":
        store.path.write_bytes(b"{")
    else:
        shutil.rmtree(tmp_path / "link")
        (tmp_path / "link").touch()
    signing = sign_link(context(request(signing_key=key_file, state=tmp_path)), loaded())
    assert isinstance(signing, LinkSigning)
    assert isinstance(signing.verifier, SignedLink), "it can be heard whether it flies"
    if resumed:
        assert timestamps_lost(signing, resumed=True) is None
        assert any("brought down anyway" in note for note in signing.notes)
    elif damage == "damaged":
        refused = refusal_of(timestamps_lost(signing, resumed=False))
        assert (refused.code, refused.slug) == (ExitCode.UNTRUSTED, "link-key-damaged")
    else:
        with pytest.raises(OSError):
            timestamps_lost(signing, resumed=False)
    signing.close()


class Grounded:
    """A flight that is reported as not flying."""

    refused = False

    def refuse(self) -> None:
        self.refused = True


def test_a_bundle_is_marked_once_and_of_two_runs_at_a_time_one_flies(tmp_path: Path) -> None:
    first, second = Grounded(), Grounded()
    assert replay_check.flown_before(tmp_path, loaded()) is None
    replay_check.mark_opened(tmp_path, loaded(), SystemClock(), cast("Any", first))
    assert not first.refused
    again = replay_check.mark_opened(tmp_path, loaded(), SystemClock(), cast("Any", second))
    assert "a bundle flies once" in refusal_of(again).text
    assert second.refused, "and its log is closed"
    assert replay_check.flown_before(tmp_path, loaded()) is not None


@pytest.mark.parametrize("own", [True, False])
def test_a_simulated_flight_and_a_real_one_use_up_no_bundle_of_each_other(tmp_path: Path, own: bool) -> None:
    """A policy flown on one does not forbid an older policy on the other."""
    orders = [request(state=tmp_path, link=link) for link in (None, "udpin:127.0.0.1:1")]
    flew, other = orders if own else reversed(orders)
    of = loaded()
    replay_check.mark_opened(flew.kept_in, of, SystemClock(), cast("Any", Grounded()))
    assert "a bundle flies once" in (not_begun(flew, of, START_CLOCK) or "")
    assert not_begun(other, of, START_CLOCK) is None
    assert (may_have_flown(flew, of), may_have_flown(other, of)) == (True, False)
    older = FileReplayStore(flew.kept_in, VEHICLE)
    older.open_once(bytes(32), LATER, 0, POLICY.name, POLICY.version + 1)
    assert not_begun(other, of, START_CLOCK) is None


def test_a_mark_that_the_disk_does_not_take_grounds_the_flight(tmp_path: Path) -> None:
    (tmp_path / "replay").write_bytes(b"")
    flight = Grounded()
    with pytest.raises(OSError, match=r"exists|Not a directory"):
        replay_check.mark_opened(tmp_path, loaded(), SystemClock(), cast("Any", flight))
    assert flight.refused


def test_policy_with_an_unavailable_signal_is_refused() -> None:
    (first, *others) = POLICY.signals
    signals = (replace(first, sources=(SignalSource("BATTERY_STATUS", ("nope",), 1, 1, ()),)), *others)
    signing: Any = SimpleNamespace(verifier=None)
    found = make_driver(context(), loaded(replace(POLICY, signals=signals), MISSION), signing, fence=True)
    refused = refusal_of(found)
    assert "`BATTERY_STATUS.nope`" in refused.text
    assert (refused.code, refused.slug) == (ExitCode.REFUSED, "unknown-source")


class Over:
    """A flight that ended."""

    def __init__(self, used_up: bool) -> None:
        self.used_up = used_up


def test_bundle_without_sent_commands_can_run_again(tmp_path: Path) -> None:
    replay_check.mark_opened(tmp_path, loaded(), SystemClock(), cast("Any", Grounded()))
    told = replay_check.give_back(tmp_path, loaded(), cast("Any", Over(used_up=False)), START)
    assert told == "no command was sent: the bundle can be run again"
    replay_check.mark_opened(tmp_path, loaded(), SystemClock(), cast("Any", Grounded()))
    assert replay_check.give_back(tmp_path, loaded(), cast("Any", Over(used_up=True)), START) is None
    assert replay_check.flown_before(tmp_path, loaded()) is not None


def test_missing_log_is_not_reported_as_interrupted(tmp_path: Path) -> None:
    """After `runs/` was deleted, the message must not refer to a missing file."""
    log = tmp_path / "runs" / "1" / "log.jsonl"
    log.parent.mkdir(parents=True)
    log.touch()
    first = LogBefore.settle(tmp_path, VEHICLE, None)
    first.begin(log)
    first._held.close()
    before = LogBefore.settle(tmp_path, VEHICLE, None)
    assert "broke off" in hanging(before, loaded())
    shutil.rmtree(log.parent)
    told = hanging(LogBefore.settle(tmp_path, VEHICLE, None), loaded())
    assert "is missing, so it is not known whether its flight ended" in told
    assert "broke off" not in told


def test_simulated_flight_does_not_affect_the_connected_vehicle(tmp_path: Path) -> None:
    """Its log and its parameters have no effect on a real vehicle."""
    simulated, real = (request(state=tmp_path, link=link).kept_in for link in (None, 1))
    log = tmp_path / "log.jsonl"
    log.touch()
    LogBefore.settle(simulated, VEHICLE, None).begin(log)
    owed = OwedParameters(simulated, VEHICLE, sets=True)
    owed.keep(
        {"FENCE_RADIUS": Owed(*settings_of(["FENCE_RADIUS=50"]).values(), *settings_of(["FENCE_RADIUS=300"]).values())}
    )
    owed.close()
    assert OwedParameters(simulated, VEHICLE).left
    assert not OwedParameters(real, VEHICLE).left
    assert LogBefore.settle(simulated, VEHICLE, None).broken_off == tmp_path
    assert (LogBefore.settle(real, VEHICLE, None).note, LogBefore.settle(real, VEHICLE, None).broken_off) == (
        "",
        None,
    )


def late(us: int) -> Now:
    """A time so long after the last moment at which a step of the mission may begin."""
    end_us = min(each.invocation.issued_at_us + each.invocation.contract.validity_us for each in loaded().invocations)
    return Now(START.monotonic_us, end_us + START.utc_error_us + us, START.utc_error_us)


def test_expired_bundle_is_reported_and_not_reusable(tmp_path: Path) -> None:
    refusal = replay_check.expired(loaded(), late(1))
    assert refusal is not None
    assert refusal.slug == "bundle-expired"
    assert "the bundle expired at 2" in refusal.text
    assert "compile the mission again" in refusal.help
    replay_check.mark_opened(tmp_path, loaded(), SystemClock(), cast("Any", Grounded()))
    told = replay_check.give_back(tmp_path, loaded(), cast("Any", Over(used_up=False)), late(1))
    assert told == f"no command was sent, and {refusal.text}; {refusal.help}"


def test_bundle_is_not_expired_while_it_may_be_fresh() -> None:
    assert replay_check.expired(loaded(), late(0)) is None
    unknown = replace(late(1 << 40), utc_error_us=UTC_UNKNOWN_US)
    assert replay_check.expired(loaded(), unknown) is None, "nobody knows the time of day"


def test_failed_release_of_a_bundle_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replay_check.mark_opened(tmp_path, loaded(), SystemClock(), cast("Any", Grounded()))

    def fails(store: FileReplayStore, digest: bytes) -> None:
        raise OSError(30, "read-only file system")

    monkeypatch.setattr(FileReplayStore, "give_back", fails)
    told = replay_check.give_back(tmp_path, loaded(), cast("Any", Over(used_up=False)), START)
    assert told == "no command was sent, but the bundle counts as flown: read-only file system"
    assert replay_check.flown_before(tmp_path, loaded()) is not None
