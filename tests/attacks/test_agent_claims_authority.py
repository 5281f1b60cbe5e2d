"""Threat: an agent's mission claims more authority than the agent has.

The agent writes any specification, and may hold an agent's mission key, with which it signs arbitrary bytes.
"""

import json
from base64 import b64encode
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference import world
from reference.documents import shorter
from reference.flat_case import MISSION, POLICY
from reference.forgery import edit, expect, flight, signed
from reference.world import FLIGHT, MISSION_KEY, ROOT, START, VEHICLE, sealed
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli import app
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import EnforcementMode, load
from rtshcua.wire import cose
from rtshcua.wire.bundle import envelopes
from rtshcua.wire.keys import ANY, Duty
from rtshcua.wire.replacement import sign_replacement
from rtshcua.wire.trust import TrustRoot, open_root
from virtual import case

CHECKOUT = Path(__file__).parents[2]
PROPOSAL = json.loads((CHECKOUT / "missions" / "proposal.json").read_text(encoding="utf-8"))
STRICT = """
import "lib:policies/site.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/return_home.rts"

policy strict version 1 {
  permit takeoff, return_home, hover, emergency_land by role operator through agent
  contingency hover for 10 s, return_home, emergency_land
}
"""

Compile = Callable[..., tuple[int, list[str], str]]


@pytest.fixture
def compiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Compile:
    """Compile a specification with keys as `keys init` makes them: exit code, codes of errors, whose key signed."""
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(tmp_path / "data"))
    assert app.main(["keys", "init"]) == ExitCode.OK
    capsys.readouterr()

    def run(specification: object, *words: str) -> tuple[int, list[str], str]:
        (tmp_path / "spec.json").write_text(json.dumps(specification), encoding="utf-8")
        (tmp_path / "strict.rts").write_text(STRICT, encoding="utf-8")
        monkeypatch.chdir(tmp_path)
        code = app.main(["compile", "spec.json", "--json", *words])
        told = json.loads(capsys.readouterr().out)
        found = [each["code"] for each in told.get("diagnostics", []) if each["severity"] == "error"]
        store = KeyStore(tmp_path / "data")
        kinds = {store.signing_key(Duty.MISSION, whose=whose).kid.hex(): whose for whose in ("agent", "operator")}
        return code, found, kinds.get((told.get("bundle") or {}).get("mission_key", ""), "")

    return run


def by(source: str, role: str = "operator") -> dict[str, object]:
    return PROPOSAL | {"proposed_by": {"source": source, "name": "openclaw", "role": role}}


UNDER = ("--policy", "bridge_inspection")


def test_agent_proposal_is_signed_with_source_agent(compiles: Compile) -> None:
    assert compiles(PROPOSAL, *UNDER) == (ExitCode.OK, [], "agent")


def test_a_specification_does_not_make_itself_operator(compiles: Compile) -> None:
    assert compiles(by("operator"), *UNDER) == (ExitCode.DIAGNOSTICS, ["E0905"], "")


def test_compile_option_marks_mission_as_a_persons(compiles: Compile) -> None:
    code, found, key = compiles(by("operator"), *UNDER, "--source", "operator")
    assert "E0905" not in found
    assert (code, key) in ((ExitCode.OK, "operator"), (ExitCode.DIAGNOSTICS, ""))
    assert compiles(PROPOSAL, *UNDER, "--source", "operator")[1] == ["E0905"]


def test_specification_cannot_claim_another_role(compiles: Compile) -> None:
    assert compiles(PROPOSAL, *UNDER, "--role", "trainee")[1] == ["E0905"]
    assert compiles(PROPOSAL, *UNDER, "--role", "operator")[0] == ExitCode.OK


def test_a_specification_does_not_choose_its_policy(compiles: Compile) -> None:
    assert compiles(PROPOSAL)[:2] == (ExitCode.DIAGNOSTICS, ["E0906"])


def test_laxer_library_policy_does_not_replace_given_one(compiles: Compile) -> None:
    assert compiles(PROPOSAL, "--with", "strict.rts")[1] == ["E0905"]
    assert compiles(PROPOSAL, "--with", "strict.rts", "--policy", "strict")[1] == ["E0905"]


def test_a_replacement_claims_no_more_than_a_mission(compiles: Compile) -> None:
    found = compiles(by("operator"), *UNDER, "--replaces", "flown.bundle", "--from", "1", "--flight", "0" * 32)
    assert found[:2] == (ExitCode.DIAGNOSTICS, ["E0905"])


def test_a_mission_of_the_library_is_pinned_as_well(compiles: Compile) -> None:
    """`--mission` selects an imported mission, which is restricted in the same way."""
    imports = [*PROPOSAL["imports"], "lib:missions/one_bridge.rts"]
    found = compiles(PROPOSAL | {"imports": imports}, *UNDER, "--role", "trainee", "--mission", "one_bridge")
    assert set(found[1]) == {"E0905"}


def test_proposer_key_cannot_sign_for_another_proposer(compiles: Compile, tmp_path: Path) -> None:
    store = KeyStore(tmp_path / "data")
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    bound = {key.sources: key.roles for key in root.keys_for(Duty.MISSION).values()}
    assert bound == {("agent",): ("operator",), ("operator",): ("operator",)}


def test_compiler_refuses_to_sign_what_root_forbids(compiles: Compile, tmp_path: Path) -> None:
    assert compiles(PROPOSAL, *UNDER)[0] == ExitCode.OK
    KeyStore(tmp_path / "data").folder.rename(tmp_path / "old")
    assert app.main(["keys", "init", "--policy", "strict"]) == ExitCode.OK
    (tmp_path / "spec.bundle").unlink()
    assert app.main(["compile", "spec.json", *UNDER]) == ExitCode.UNTRUSTED
    assert not (tmp_path / "spec.bundle").exists()


def rooted(**bound: tuple[str, ...]) -> TrustRoot:
    """The root, with another authorisation of the mission key."""
    keys = tuple(replace(key, **bound) if key.duty is Duty.MISSION else key for key in ROOT.keys)
    return replace(ROOT, keys=keys)


def opened(root: TrustRoot, mission: Mission = MISSION) -> str:
    """The boundary's refusal slug for a mission signed by the attacker, or None."""
    found = load(
        sealed(POLICY, mission), root=root, vehicle=VEHICLE, now=START, mode=EnforcementMode.SOFTWARE,
        session_key=bytes(32), flight=bytes(16), peer_is_own_simulator=True,
    )  # fmt: skip
    return found.slug if isinstance(found, Refusal) else ""


def through(source: SourceKind) -> Mission:
    steps = tuple(replace(each, source=source) for each in MISSION.invocations)
    return replace(MISSION, invocations=steps)


def test_boundary_restricts_mission_key_to_source_role_and_policy() -> None:
    assert opened(ROOT) == ""
    assert opened(rooted(sources=("agent",)), through(SourceKind.OPERATOR)) == "wrong-source"
    assert opened(rooted(roles=("trainee",))) == "wrong-role"
    assert opened(rooted(policies=("a_stricter_one",))) == "key-other-policy"
    assert opened(rooted(policies=())) == "key-other-policy"
    assert opened(rooted(policies=(ANY,))) == ""


@pytest.mark.parametrize(
    ("bound", "slug"),
    [
        ({"policies": ("a_stricter_one",)}, "trust/bundle-key-other-policy"),
        ({"roles": ("trainee",)}, "trust/bundle-wrong-role"),
        ({"sources": ("onboard",)}, "trust/bundle-wrong-source"),
    ],
)
def test_audit_restricts_mission_key_too(bound: dict[str, tuple[str, ...]], slug: str) -> None:
    """The log of a flight whose boundary did not check."""
    made, _ = case.root()
    keys = tuple(replace(key, **bound) if key.duty is Duty.MISSION else key for key in made.keys)
    root = replace(made, keys=keys).sign(case.KEYS[Duty.ROOT])
    first, *rest = flight()
    assert expect(signed([edit(first, root=b64encode(root).decode()), *rest])) == (slug, 0)


def test_agent_cannot_replace_steps_of_a_person() -> None:
    """Its key signs a mission that replaces steps of an operator which have not begun."""
    flying = world.loaded(POLICY, through(SourceKind.OPERATOR))
    taken = world.renewed(flying, rooted(sources=("agent",)))
    whole = replace(shorter(flying), invocations=tuple(
        replace(each, source=SourceKind.AGENT) for each in shorter(flying).invocations
    ))  # fmt: skip
    document = sign_replacement(whole, over=flying.bundle, flight=FLIGHT, kept=0, key=MISSION_KEY)
    now = Now(START.monotonic_us + 1, START.utc_us + 1, START.utc_error_us)
    assert taken.in_force.take(document, now, decided=0, released=0).slug == "wrong-source"
    agents = world.loaded(POLICY, through(SourceKind.AGENT))
    again = world.renewed(agents, rooted(sources=("agent",)))
    document = sign_replacement(whole, over=agents.bundle, flight=FLIGHT, kept=0, key=MISSION_KEY)
    assert again.in_force.take(document, now, decided=0, released=0).accepted


def test_the_payload_of_a_mission_names_no_key() -> None:
    """The envelope names the signer, and the root decides what that key may sign."""
    _, mission = envelopes(sealed())
    assert cose.unverified(mission).kid == MISSION_KEY.kid
