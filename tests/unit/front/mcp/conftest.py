"""The tools of an MCP server whose vehicle is not there."""

from pathlib import Path

import pytest

from rtshcua.app.propose import Missions
from rtshcua.front.mcp import tools as desks
from rtshcua.front.mcp.flight import Following
from rtshcua.front.mcp.tools import Signer, Tools
from rtshcua.wire import cose, names
from rtshcua.wire.bundle import policy_digest, policy_payload
from rtshcua.wire.keys import Duty, SigningKey

CHECKOUT = Path(__file__).resolve().parents[4]
POLICY = SigningKey.from_seed(bytes([2]) * 32, duty=Duty.POLICY, development=True)
AGENT = SigningKey.from_seed(bytes([3]) * 32, duty=Duty.MISSION, development=True)


@pytest.fixture(scope="module")
def missions() -> Missions:
    return Missions([CHECKOUT / "policies/bridge_inspection.rts"])


@pytest.fixture
def handed(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """The documents sent to the vehicle, which accepts all."""
    found: list[bytes] = []

    def hand_in(socket: Path, document: bytes) -> tuple[str, str]:
        found.append(document)
        return "accepted", "it flies"

    monkeypatch.setattr(desks, "hand_in", hand_in)
    return found


@pytest.fixture
def desk(missions: Missions, tmp_path: Path) -> Tools:
    payload = policy_payload(missions.policy)
    envelope = cose.sign1(payload, key=POLICY, duty=Duty.POLICY, content_type=names.POLICY.content_type)
    following = Following(tmp_path / "none.sock")
    following.await_first()  # its thread changes nothing after that
    following.end()
    signer = Signer(AGENT, envelope, policy_digest(payload), lambda policy, mission: None)
    return Tools(missions, signer, tmp_path / "none.sock", following)
