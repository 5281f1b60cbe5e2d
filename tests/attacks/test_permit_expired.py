"""Permits that are used late, or after the command that they cover is over."""

import pytest

from reference.flat_case import S
from reference.world import SESSION_KEY, START, allowed, loaded
from rtshcua.onboard.enforcement.executor import FORGED, LAPSED, LATE, NOT_COVERED
from rtshcua.onboard.ports import Command
from rtshcua.wire.permit import open_permit
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK

AT = START.monotonic_us


def test_a_late_step_is_not_sent() -> None:
    of = loaded()
    permit = allowed(of)
    opened = open_permit(permit, SESSION_KEY)
    assert opened is not None
    assert AT < opened.not_after_us <= AT + 2 * S, "at most the deadline"
    assert of.executor.dispatch(permit, opened.not_after_us + 1) is LATE
    dispatch = of.executor.dispatch(permit, opened.not_after_us)
    assert isinstance(dispatch, Command)
    assert dispatch.not_after_us == opened.not_after_us, "whoever sends looks at the clock again"


def test_link_permit_is_valid_for_a_second() -> None:
    of = loaded()
    allowed(of)
    permit = allowed(of, kind=2, step=-1, link=0)
    assert of.executor.dispatch(permit, AT + S + 1) is LATE


def test_the_fallback_of_a_step_that_is_over_has_lapsed() -> None:
    of = loaded()
    step = allowed(of)
    of.executor.dispatch(step, AT)
    of.executor.ended()
    following = allowed(of, step=1)
    assert isinstance(of.executor.dispatch(following, AT), Command)
    assert of.executor.stand_in(step, FALLBACK_LINK, 0, AT) is LAPSED
    assert isinstance(of.executor.stand_in(following, FALLBACK_LINK, 0, AT), Command)


def test_unsent_step_covers_no_links() -> None:
    of = loaded()
    step = allowed(of)
    assert of.executor.stand_in(step, FALLBACK_LINK, 0, AT) is LAPSED
    assert of.executor.stand_in(step, CONTINGENCY_LINK, 0, AT) is LAPSED


@pytest.mark.parametrize(("kind", "link"), [(1, 1), (1, -1), (2, 3), (2, -1), (0, 3)])
def test_permit_covers_only_its_own_links(kind: int, link: int) -> None:
    of = loaded()
    step = allowed(of)
    of.executor.dispatch(step, AT)
    assert of.executor.stand_in(step, kind, link, AT) is NOT_COVERED


def test_link_permit_covers_no_links() -> None:
    of = loaded()
    of.executor.dispatch(allowed(of), AT)
    hold = allowed(of, kind=2, step=-1, link=0)
    assert of.executor.stand_in(hold, FALLBACK_LINK, 0, AT) is NOT_COVERED


def test_landing_ends_standing_permits() -> None:
    of = loaded()
    step = allowed(of)
    of.executor.dispatch(step, AT)
    of.executor.landed()
    for kind in (FALLBACK_LINK, CONTINGENCY_LINK):
        assert of.executor.stand_in(step, kind, 0, AT) is LAPSED
    following = allowed(of, step=1)
    assert isinstance(of.executor.dispatch(following, AT), Command)
    assert of.executor.stand_in(step, CONTINGENCY_LINK, 0, AT) is LAPSED, "that was another flight"


def test_the_contingency_stands_through_all_steps_of_a_flight() -> None:
    of = loaded()
    step = allowed(of)
    of.executor.dispatch(step, AT)
    of.executor.ended()
    of.executor.dispatch(allowed(of, step=1), AT)
    assert isinstance(of.executor.stand_in(step, CONTINGENCY_LINK, 0, AT + 3_600 * S), Command)


def test_forged_permit_covers_no_links() -> None:
    of = loaded()
    of.executor.dispatch(allowed(of), AT)
    assert of.executor.stand_in(bytes(56), CONTINGENCY_LINK, 0, AT) is FORGED
