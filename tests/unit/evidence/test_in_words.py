"""Decisions in the form of log records, and the subject of a record."""

from collections.abc import Callable

import pytest

from reference import flat_case as flat
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import DecisionRecord, Effect, in_words
from rtshcua.model.decision import Decision as Decided
from rtshcua.model.flat.situation import Now
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.request import NOTHING, Ref


@pytest.mark.parametrize("outcome", Outcome)
def test_an_answer_without_clause_and_target(outcome: Outcome) -> None:
    words = outcome.name.lower()
    decided = Decided(outcome, Reason.ADMITTED, 8, None, None, None, 9)
    assert in_words(decided) == (words, "admitted", 8, None, None, None, -1, 9)


def test_an_answer_names_its_clause_and_its_target() -> None:
    clause, target = flat.RULES[0], flat.POLICY.contingency[1]
    place = (clause.source, clause.start, clause.end)
    decided = Decided(Outcome.FALLBACK, Reason.NO_SLACK, 5, clause, 1, target, 9)
    assert in_words(decided) == ("fallback", Reason.NO_SLACK.value, 5, clause.text, place, target.text, 1, 9)


def test_admitted_link_is_not_a_target_of_its_record() -> None:
    decided = Decided(Outcome.ALLOW, Reason.ADMITTED, 8, None, None, flat.POLICY.contingency[1], 9)
    assert in_words(decided) == ("allow", "admitted", 8, None, None, None, -1, 9)


def test_records_refer_to_their_subject(
    recorder: Recorder, begin: Callable[[], bytes], decide: Callable[..., bytes], now: Callable[[int], Now]
) -> None:
    begin()
    decision = read(decide(1, ref=Ref(1, 2, 3)))
    effect, other = read(recorder.effect(now(2), "sent", Ref(2, -1, 1))), read(recorder.effect(now(3), "ready"))
    assert isinstance(decision, DecisionRecord)
    assert isinstance(effect, Effect)
    assert isinstance(other, Effect)
    assert (decision.ref, effect.ref, other.ref) == (Ref(1, 2, 3), Ref(2, -1, 1), NOTHING)
