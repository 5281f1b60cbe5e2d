"""Threats to a vehicle that waits for a mission: somebody with access to the agent socket flies an unauthorised
mission.

They hold the waiting bundle, which names the policy, and an agent's mission key.
"""

import secrets
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from reference.flying import context, request
from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.fly.vehicle_trust import trust
from rtshcua.app.fly.verify_bundle import load_bundle
from rtshcua.app.fly.waiting import admit_bundle
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.app import main
from rtshcua.library import root as library
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire.keys import Duty

PROPOSAL, POLICY = library() / "missions" / "proposal.json", library() / "policies" / "bridge_inspection.rts"
OF_A_PERSON = """import "lib:policies/bridge_inspection.rts"

mission by_hand under bridge_inspection@7 on quad {
  intent "Up and down."
  proposed by operator ada for role operator
  phase departure { takeoff(altitude = 25 m) }
  phase recovery { return_home() }
}
"""


@pytest.fixture
def hand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    """What becomes of a file at the socket of a vehicle that waits with `base.bundle`, a person's: `accepted`, or why
    not.
    """
    monkeypatch.chdir(tmp_path)
    Path("person.rts").write_text(OF_A_PERSON)
    assert main(["keys", "init"]) == ExitCode.OK
    assert main(["compile", "person.rts", "-o", "base.bundle"]) == ExitCode.OK
    clock, base = SystemClock(), Path("base.bundle")
    trusted = trust((), data_folder(), state_folder(), "quad-07", clock.now().utc_us)
    order = request(bundle=base, data=data_folder(), state=state_folder(), wait_s=60)
    waits = load_bundle(order, base.read_bytes(), trusted.root, clock.now(), secrets.token_bytes(16))
    assert isinstance(waits, Loaded)
    signing: Any = SimpleNamespace(unheard=frozenset())
    log_key = KeyStore(data_folder()).signing_key(Duty.LOG).kid

    def handed(name: str) -> str:
        outcome = admit_bundle(context(order, clock), Path(name).read_bytes(), waits, trusted, log_key, signing)
        assert isinstance(outcome, Loaded | Refusal)
        return outcome.slug if isinstance(outcome, Refusal) else "accepted"

    return handed


def test_mission_signed_by_agent_flies(hand_in: Callable[[str], str]) -> None:
    assert main(["compile", str(PROPOSAL), "--with", str(POLICY), "-o", "own.bundle"]) == ExitCode.OK
    assert hand_in("own.bundle") == "accepted"


def test_waiting_mission_does_not_fly(hand_in: Callable[[str], str]) -> None:
    """A person may have signed it, with rights that no agent has."""
    assert hand_in("base.bundle") == "waited-with"
