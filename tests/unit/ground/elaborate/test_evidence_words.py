"""Durability of records, `without evidence` and `without link`, from the source to the flat form."""

from collections.abc import Callable

import pytest

from rtshcua.decision.durability import durability_of
from rtshcua.diagnostics.render import render
from rtshcua.ground.pipeline.program import Compiled
from rtshcua.model.durability import SYNCED, SYNCED_FIRST, WRITTEN
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import AfterSilence, WithoutEvidence
from rtshcua.model.outcome import Outcome
from rtshcua.wire.request import STEP

Compile = Callable[..., Compiled]

TEXT = """
skill probe() {{
  motion hold  class tactical  deadline 5 s  valid for 40 min  lasts at most 20 s
  fallback return_home, emergency_land  energy at most 4 %  {record}
}}
policy p version 1 {{
  permit takeoff by role operator through agent when altitude <= 40 m
  permit probe, return_home, emergency_land, hover by any
  contingency hover for 10 s, return_home, emergency_land
  {without}
}}
mission m under p@1 on quad {{
  proposed by agent openclaw for role operator
  phase departure {{ takeoff(altitude = 10 m) probe() {block} return_home() }}
}}
"""


def compiled(compile_text: Compile, site: str, record: str = "", block: str = "", without: str = "") -> Compiled:
    made = compile_text(site + TEXT.format(record=record, block=block, without=without))
    assert made.policy is not None, render(made.diagnostics, made.sources)
    return made


def probe(made: Compiled) -> Invocation:
    assert made.mission is not None
    return made.mission.invocations[1]


@pytest.mark.parametrize(
    ("record", "block", "expected"),
    [
        ("", "", SYNCED),
        ("record written", "", WRITTEN),
        ("record decision, state, authorization", "", SYNCED),
        ("record decision, state, authorization, synced_first", "", SYNCED_FIRST),
        ("record written", "{ record synced }", SYNCED),
        ("record written", "{ record written, effect }", WRITTEN),
        ("", "{ record synced_first }", SYNCED_FIRST),
        ("record synced", "{ record effect }", SYNCED),
    ],
)
def test_durability_of_records(compile_text: Compile, site: str, record: str, block: str, expected: int) -> None:
    contract = probe(compiled(compile_text, site, record, block)).contract
    assert durability_of(contract, Outcome.ALLOW, confirmed=False, kind=STEP) == expected
    assert {"decision", "state", "authorization"} <= set(contract.record)


def test_durability_is_the_last_word_and_written_once(compile_text: Compile, site: str) -> None:
    contract = probe(compiled(compile_text, site, "record written", "{ record synced_first, synced_first }")).contract
    assert contract.record == ("intent", "decision", "state", "authorization", "effect", "synced_first")


def test_takeoff_is_always_synced_first(compile_text: Compile, site: str) -> None:
    made = compiled(compile_text, site)
    assert made.mission is not None
    contract = made.mission.invocations[0].contract
    assert durability_of(contract, Outcome.ALLOW, confirmed=False, kind=STEP) == SYNCED_FIRST


@pytest.mark.parametrize(
    ("without", "expected"),
    [
        ("", WithoutEvidence.LAND),
        ("without evidence land", WithoutEvidence.LAND),
        ("without evidence refuse", WithoutEvidence.REFUSE),
    ],
)
def test_without_evidence(compile_text: Compile, site: str, without: str, expected: WithoutEvidence) -> None:
    policy = compiled(compile_text, site, without=without).policy
    assert policy is not None
    assert policy.without_evidence == expected


@pytest.mark.parametrize(
    ("without", "silence_us", "expected"),
    [
        ("", 30_000_000, AfterSilence.CONTINGENCY),
        ("without link for 5 s contingency", 5_000_000, AfterSilence.CONTINGENCY),
        ("without link for 30 s continue", 30_000_000, AfterSilence.CONTINUE),
        ("without evidence refuse  without link for 1 h continue", 3_600_000_000, AfterSilence.CONTINUE),
    ],
)
def test_without_link(compile_text: Compile, site: str, without: str, silence_us: int, expected: AfterSilence) -> None:
    policy = compiled(compile_text, site, without=without).policy
    assert policy is not None
    assert (policy.silence_us, policy.after_silence) == (silence_us, expected)


@pytest.mark.parametrize(
    ("limit", "code"), [("0 s", "E0319"), ("-1 s", "E0319"), ("61 min", "E1003"), ("30 m", "E0310")]
)
def test_silence_must_be_positive_and_bounded(compile_text: Compile, site: str, limit: str, code: str) -> None:
    without = f"without link for {limit} contingency"
    found = compile_text(site + TEXT.format(record="", block="", without=without)).diagnostics
    assert [each.code.id for each in found] == [code]


@pytest.mark.parametrize(
    "without",
    [
        "without evidence",
        "without evidence fly",
        "without refuse",
        "without link contingency",
        "without link for 30 s",
        "without link for 30 s land",
    ],
)
def test_invalid_without_clause_is_refused(compile_text: Compile, site: str, without: str) -> None:
    found = compile_text(site + TEXT.format(record="", block="", without=without)).diagnostics
    assert found[0].code.id == "E0101"


@pytest.mark.parametrize(
    "twice",
    [
        "without evidence land  without evidence refuse",
        "without link for 30 s continue  without link for 30 s continue",
    ],
)
def test_clause_is_written_once(compile_text: Compile, site: str, twice: str) -> None:
    found = compile_text(site + TEXT.format(record="", block="", without=twice)).diagnostics
    assert found[0].code.id == "E0106"
