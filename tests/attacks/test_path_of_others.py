"""Threat: a holder of a mission key signs another path in the zone than skill and arguments describe, and gets it
approved.
"""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.ground.geometry.shapes import shape_of
from rtshcua.ground.geometry.survey import PathAim, survey
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire import cose, names
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import envelopes, mission_payload, parse, policy_digest, seal_under
from rtshcua.wire.keys import Duty

LOW = """import "lib:policies/bridge_inspection.rts"

mission low under bridge_inspection@7 on quad {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 9 m) }
  phase inspection {
    goto(bridge_a.entry, altitude = 9 m)
    inspect_area(bridge_a, altitude = 9 m, pattern = perimeter)
  }
  phase recovery { return_home() }
}
"""
APPROVE = ("approve", "low.bundle", "--step", "3", "-o", "yes", "--flight", bytes(16).hex())

Sign = Callable[[Callable[[Invocation, Policy], Invocation]], None]


@pytest.fixture
def sign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Sign:
    """Signs the mission with its inspection changed, by the agent's own key."""
    monkeypatch.chdir(tmp_path)
    assert main(["keys", "init"]) == ExitCode.OK
    assert main(["keys", "approver", "owner", "--role", "supervisor"]) == ExitCode.OK
    Path("low.rts").write_text(LOW)
    assert main(["compile", "low.rts"]) == ExitCode.OK
    capsys.readouterr()

    def signed(change: Callable[[Invocation, Policy], Invocation]) -> None:
        envelope, given = envelopes(Path("low.bundle").read_bytes())
        payload = cose.unverified(envelope).payload
        policy = parse(names.POLICY, payload, Policy)
        mission = parse(names.MISSION, cose.unverified(given).payload, Mission)
        steps = list(mission.invocations)
        steps[2] = change(steps[2], policy)
        bound = bind(replace(mission, invocations=tuple(steps)), policy_digest(payload))
        key = KeyStore(data_folder()).signing_key(Duty.MISSION, whose="agent")
        Path("low.bundle").write_bytes(seal_under(envelope, mission_payload(bound), mission_key=key))

    return signed


def near_the_entry(one: Invocation, _: Policy) -> Invocation:
    """A path that stays at one corner of the zone for the whole step, without an inspection."""
    return replace(one, plan=replace(one.plan, path=one.plan.path[:2] * 40))


def test_changed_path_is_not_approved_by_plain_yes(sign: Sign, capsys: pytest.CaptureFixture[str]) -> None:
    sign(near_the_entry)
    for words in ((), ("--yes",)):
        assert main([*APPROVE, *words]) == ExitCode.REFUSED
        err = capsys.readouterr().err
        assert "along 40 points, 0.0 m in all" in err
        assert "differs from the planner's: the planner's path has 5 points, " in err
        assert "--other-path" in err
    assert main([*APPROVE, "--json"]) == ExitCode.REFUSED
    assert json.loads(capsys.readouterr().out)["error"]["slug"] == "other-path"
    assert not Path("yes").exists()


@pytest.mark.parametrize("words", ["--refuse", "--other-path"])
def test_changed_path_needs_explicit_confirmation(words: str, sign: Sign, capsys: pytest.CaptureFixture[str]) -> None:
    sign(near_the_entry)
    assert main([*APPROVE, words]) == ExitCode.OK
    said = capsys.readouterr()
    assert "the path in the mission differs from the planner's" in said.err
    assert "a path that differs from the planner's" in said.out
    assert Path("yes").exists()


def test_planner_path_needs_no_extra_confirmation(sign: Sign, capsys: pytest.CaptureFixture[str]) -> None:
    sign(lambda one, _: one)
    assert main([*APPROVE]) == ExitCode.OK
    said = capsys.readouterr()
    assert "planner" not in said.out + said.err


def one_line(one: Invocation, policy: Policy) -> Invocation:
    """A grid of one line over the whole zone, as if for a camera that sees all of it at once."""
    arguments = (*one.arguments[:2], 0, *one.arguments[3:])
    shape = shape_of(policy.zones[arguments[0]])
    assert shape is not None
    path = survey(shape, "grid", 9_000, policy.vehicle.position_error, None, PathAim(spacing=10**6))
    assert path is not None
    assert len(path) == 2
    flat = tuple(coordinate for point in path for coordinate in point)
    return replace(one, arguments=arguments, plan=replace(one.plan, path=flat))


def test_sparse_grid_is_told_with_its_spacing(sign: Sign, capsys: pytest.CaptureFixture[str]) -> None:
    sign(one_line)
    main([*APPROVE])
    assert "its grid has a line every " in capsys.readouterr().err


def test_any_path_counts_as_changed_without_planner_path(sign: Sign, capsys: pytest.CaptureFixture[str]) -> None:
    sign(lambda one, _: replace(one, arguments=(*one.arguments[:2], 7, *one.arguments[3:])))
    assert main([*APPROVE]) == ExitCode.REFUSED
    assert "the planner finds none there" in capsys.readouterr().err


def unknown_skill(one: Invocation, policy: Policy) -> Invocation:
    confirmed = next(rule.skills[0] for rule in policy.rules if rule.approver >= 0 and rule.skills)
    assert confirmed == one.skill
    return replace(one, arguments=one.arguments[:1])


def test_unloadable_bundle_is_not_approved(sign: Sign, capsys: pytest.CaptureFixture[str]) -> None:
    """A signed malformed bundle causes neither a traceback nor an approval."""
    for change in (unknown_skill, lambda one, _: replace(one, plan=replace(one.plan, altitude=50_000))):
        sign(change)
        for words in ((), ("--refuse",)):
            assert main([*APPROVE, *words]) == ExitCode.INPUT
            assert "would be refused on board" in capsys.readouterr().err
    assert not Path("yes").exists()
