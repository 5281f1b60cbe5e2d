"""The approvals that a flight stores: their number is limited, and stored ones stay."""

import pytest
from msgspec.structs import replace

from reference.flat_case import ISSUED, MISSION, POLICY, SUPERVISOR
from rtshcua.model.flat.situation import Now
from rtshcua.wire import approval
from rtshcua.wire.approval import Answered, Approvals
from rtshcua.wire.document import DocumentError

NOW = Now(1_000, ISSUED, 0)


def answered(step: int) -> Answered:
    about = replace(MISSION.invocations[0], step=step, invocation_id=bytes([step]) * 16)
    return Answered(about, SUPERVISOR, 7, 1, 1_000, ISSUED + 60_000_000)


def slug(of: Approvals, step: int) -> str:
    try:
        of.add(answered(step), NOW)
    except DocumentError as error:
        return error.slug
    return "kept"


def test_answer_beyond_limit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(approval, "MAX_ANSWERS", 3)
    of = Approvals(POLICY)
    assert [slug(of, step) for step in range(5)] == ["kept"] * 3 + ["too-many"] * 2
    assert slug(of, 0) == "already-answered"
