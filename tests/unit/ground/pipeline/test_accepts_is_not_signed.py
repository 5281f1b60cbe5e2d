"""What a skill accepts of MAVLink is no part of what is signed."""

import re
from functools import cache
from pathlib import Path

import pytest
from msgspec import structs

from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire.bundle import mission_payload, policy_payload

CHECKOUT = Path(__file__).resolve().parents[4]
#: the first `accepts` of a skill, and all up to the end of the skill
ACCEPTS = re.compile(r"^  accepts\b.*?(?=^})", re.MULTILINE | re.DOTALL)


@cache
def compiled(*, without: bool) -> tuple[Policy, Mission]:
    """A policy and a mission of the library, with and without `accepts`, which are then blanks of the same length."""
    replaced = 0

    def read(path: str) -> bytes:
        nonlocal replaced
        text = Path(path).read_text(encoding="utf-8")
        if without:
            text, number = ACCEPTS.subn(lambda found: re.sub(r"\S", " ", found[0]), text)
            replaced += number
        return text.encode()

    program = load([str(CHECKOUT / "missions" / "standard.rts")], read, str(CHECKOUT))
    accepted = sum(len(skill.accepts) for unit in program.units for skill in unit.skills)
    assert (accepted == 0 and replaced == 5) if without else accepted > 20
    found = compile_program(program, dialect.load(), mission="standard", issued_at_us=0)
    assert found.policy is not None
    assert found.mission is not None, found.diagnostics
    return found.policy, found.mission


@pytest.mark.slow
def test_only_the_digests_of_sources_differ() -> None:
    (policy, mission), (other_policy, other_mission) = compiled(without=False), compiled(without=True)
    assert policy.source_digests != other_policy.source_digests
    assert policy_payload(policy) != policy_payload(other_policy)
    same = policy_payload(structs.replace(other_policy, source_digests=policy.source_digests))
    assert same == policy_payload(policy)
    digests = {"source_digests": mission.source_digests, "policy_digest": mission.policy_digest}
    assert mission_payload(structs.replace(other_mission, **digests)) == mission_payload(mission)
