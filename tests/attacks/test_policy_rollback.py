"""Threat: an older, correctly signed and laxer policy than the one in force is loaded again."""

from pathlib import Path

from msgspec.structs import replace

from reference.flat_case import MISSION, POLICY
from reference.world import START, VEHICLE, loaded
from rtshcua.adapters.store.opened_missions import FileReplayStore
from rtshcua.onboard.ports import MissionOpening


def opens(store: FileReplayStore, version: int) -> MissionOpening:
    of = loaded(replace(POLICY, version=version), replace(MISSION, policy_version=version))
    policy = of.bundle.policy
    return store.open_once(of.bundle.mission_digest, of.expires_us, START.utc_us, policy.name, policy.version)


def test_older_policy_is_refused(tmp_path: Path) -> None:
    store = FileReplayStore(tmp_path, VEHICLE)
    assert opens(store, 7) is MissionOpening.OPENED
    assert opens(store, 6) is MissionOpening.OLD_POLICY
    assert opens(store, 8) is MissionOpening.OPENED
    assert opens(store, 7) is MissionOpening.REPLAYED
