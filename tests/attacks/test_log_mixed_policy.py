"""Threat: the policy of the log is mixed with another version: in the genesis, or in single decisions."""

from base64 import b64encode

import pytest
from msgspec.structs import replace

from reference.forgery import edit, expect, flight, read, rewritten, signed, signers
from virtual import case

LINES = flight()
DECISIONS = [number for number, line in enumerate(LINES) if read(line)["type"] == "decision"]


def of_another_version() -> str:
    """The same mission under the next version of the policy, signed as it should be."""
    policy = case.policy()
    newer = replace(policy, version=policy.version + 1)
    return b64encode(case.seal(case.mission(case.short_steps()), newer)).decode()


def test_a_bundle_with_another_version_of_the_policy() -> None:
    mixed = [edit(LINES[0], bundle=of_another_version()), *LINES[1:]]
    assert expect(mixed) == ("seal/self", 0)
    assert expect(rewritten(mixed)) == ("seal/self", 0)
    assert expect(signed(mixed)) == ("trust/bundle-wrong-policy", 0)


@pytest.mark.parametrize("number", DECISIONS)
def test_a_decision_that_names_another_version(number: int) -> None:
    context = read(LINES[number])["context"]
    context["policy_version"] += 1
    mixed = [*LINES[:number], edit(LINES[number], context=context), *LINES[number + 1 :]]
    seal = next(each for each in signers(LINES) if each > number)
    assert expect(mixed) == ("chain/broken", number)
    assert expect(rewritten(mixed)) == ("seal/root", seal)
    slug, record = expect(signed(mixed))
    assert (slug.partition("/")[0], record) == ("decision", number)


def test_all_decisions_that_name_another_version() -> None:
    mixed = list(LINES)
    for number in DECISIONS:
        context = read(LINES[number])["context"]
        mixed[number] = edit(LINES[number], context=context | {"policy_version": context["policy_version"] + 1})
    slug, record = expect(signed(mixed))
    assert (slug.partition("/")[0], record) == ("decision", DECISIONS[0])
