"""The policy of `--allow` is made again where the vehicle has landed away from its home, and the change is shown."""

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from rtshcua.app.gateway.configuration import ConfiguredClient, GatewayConfiguration
from rtshcua.app.gateway.policy_in_force import PolicyInForce
from rtshcua.app.gateway.quick_policy import QuickRules
from rtshcua.app.gateway.starting import GatewayRequest, _Starting
from rtshcua.front.cli.unlock import unlock
from rtshcua.model.flat.situation import Now

NOW = Now(0, 0, 0)


class Told:
    def __init__(self) -> None:
        self.events: list[Mapping[str, Any]] = []

    def tell(self, event: Mapping[str, object]) -> None:
        self.events.append(event)


def test_a_landing_elsewhere_shows_why_and_what_changed_and_keeps_both_policies(
    own_world: None, tmp_path: Path
) -> None:
    """By hand: 12 m north and 5 m west of home are 13 m. The declared home is good for 5 m."""
    told, saved = Told(), tmp_path / "kept"
    configuration = GatewayConfiguration(clients=(ConfiguredClient("script", "udpin:127.0.0.1:9"),))
    rules = QuickRules(("takeoff", "goto", "emergency_land"), 30_000, (), "gateway-01")
    request = GatewayRequest(configuration, rules, saved)
    (tmp_path / "work").mkdir()
    with ExitStack() as stack:
        keys: Any = lambda store: lambda duty, whose: unlock(store, duty, whose=whose, passphrase_file=None)  # noqa: E731
        starting = _Starting(request, told, keys, stack, tmp_path / "work")
        policy = starting._policy()
        assert isinstance(policy, PolicyInForce)
        first = (saved / "policy.rts").read_text()
        assert "--allow takeoff,goto,land --below" in first

        def landed(*place: int) -> Any:
            return SimpleNamespace(policy=cast(PolicyInForce, policy).prepared.policy, landed_at=lambda now: place)

        assert starting._renewed(landed(3_000, 3_000), NOW) is None
        renewed = starting._renewed(landed(-5_000, 12_000), NOW)
        assert isinstance(renewed, PolicyInForce)
    assert [each["event"] for each in told.events] == ["policy", "policy"]
    assert told.events[1]["why"] == "the vehicle landed 13 m from its home"
    changed = told.events[1]["changed"]
    assert 4 <= len(changed) <= 6, changed
    assert {each[:2] for each in changed} == {"- ", "+ "}
    assert (saved / "policy-1.rts").read_text() == first
    assert (saved / "policy.rts").read_text() == told.events[1]["text"]
    assert "version 2" in told.events[1]["text"]


@pytest.mark.parametrize("broken", [True, False])
def test_a_saved_policy_that_is_gone_or_cannot_be_written_is_noted(
    own_world: None, tmp_path: Path, broken: bool
) -> None:
    told = Told()
    request = GatewayRequest(GatewayConfiguration(), None, tmp_path / "kept")
    with ExitStack() as stack:
        starting = _Starting(request, told, cast(Any, None), stack, tmp_path)
        if broken:
            (tmp_path / "kept").write_text("no folder")
        else:
            (tmp_path / "kept").mkdir()
        starting._save_renewed(tmp_path / "kept", 1)
    assert [each["event"] for each in told.events] == (["note"] if broken else [])
