"""A single report is not trusted on a link that anybody can write to; alternating reports show two senders."""

import pytest

from rtshcua.adapters.vehicle.source_time import SourceTime
from rtshcua.adapters.vehicle.suspicion import OFTEN, UNBROKEN_US, WITHIN_US, Contradictions, Suspicion

S = 1_000_000
LAND = ("mode", "Land", 7)


def judged(suspicion: Suspicion, found: tuple[str, str, int] | None, up_us: int = S, **more: bool) -> str | None:
    return suspicion.judge(found, up_us, disputed=more.get("disputed", False), at_once=more.get("at_once", False))


def test_suspicion_needs_a_second_report_of_its_kind() -> None:
    one = Suspicion()
    assert judged(one, LAND) is None
    assert judged(one, LAND) is None, "nothing new came"
    assert one.stands
    assert judged(one, ("mode", "Return", 8)) == "Return"
    assert not one.stands


def test_refuted_suspicion_is_reported() -> None:
    one = Suspicion()
    judged(one, LAND)
    assert judged(one, None) is None
    assert (one.stands, one.refuted) == (False, "Land")


def test_report_of_another_kind_does_not_confirm() -> None:
    one = Suspicion()
    judged(one, LAND)
    assert judged(one, ("target", "another target", 30)) is None
    assert judged(one, ("target", "another target", 31)) == "another target"


def test_near_a_frame_of_ours_one_report_counts_but_not_while_two_speak() -> None:
    assert judged(Suspicion(), LAND, at_once=True) == "Land"
    assert judged(Suspicion(), LAND, at_once=True, disputed=True) is None


def test_suspicion_with_two_senders_is_confirmed_by_time() -> None:
    one = Suspicion()
    judged(one, LAND, S, disputed=True)
    assert judged(one, ("mode", "Land", 9), S + UNBROKEN_US - 1, disputed=True) is None
    assert judged(one, ("mode", "Land", 20), S + UNBROKEN_US, disputed=True) == "Land"


@pytest.mark.parametrize(("each_us", "stand"), [(WITHIN_US // OFTEN, True), (WITHIN_US, False)])
def test_values_that_go_back_and_forth_are_of_two(each_us: int, stand: bool) -> None:
    one = Contradictions()
    for number in range(OFTEN + 2):
        one.report(number % 2, number * each_us)
    assert one.stand((OFTEN + 1) * each_us) == stand
    assert not one.stand((OFTEN + 1) * each_us + WITHIN_US + 1)


def test_values_that_only_go_on_are_of_one() -> None:
    one = Contradictions()
    for number in range(20):
        one.report(number // 4, number * 100_000)
    assert not one.stand(2 * S)


def test_forged_sequence_number_makes_few_frames_late() -> None:
    """Regression: up to 127 later frames of the vehicle counted as overtaken."""
    source = SourceTime()
    for number in range(20):
        source._follow(number, None, number * 1_000)
    source._follow(90, None, 20_000)
    forged = source.place
    late = 0
    for number in range(20, 60):
        source._follow(number, None, number * 1_000 + 1_000)
        late += source.place < forged
    assert late <= 6
    before = source.place
    source._follow(60, None, 70_000)
    assert source.place == before + 1
