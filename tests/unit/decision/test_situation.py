"""A single situation as sets of values: exactly the slots that are missing, stale or out of range are MISSING."""

from reference import flat_case as flat
from reference.asking import POLICY
from rtshcua.decision.situation import situation
from rtshcua.decision.values import MISSING, PRESENT, Value
from rtshcua.model.flat.situation import State
from virtual.rows import rows

FRESH = flat.state()
SLOTS = range(flat.SLOTS)


def values_of(state: State) -> list[Value]:
    return list(situation(state, POLICY, flat.NOW).values)


def known(value: int | None) -> Value:
    assert value is not None
    return value, value, PRESENT, None


def test_known_slots_have_their_reported_values() -> None:
    assert values_of(FRESH) == [known(value) for value in FRESH.values]


@rows("slot", SLOTS)
def test_a_slot_is_missing_from_its_limits_on_and_no_other_is(slot: int) -> None:
    stale_us, most = POLICY.limits[slot]
    usual = [known(value) for value in FRESH.values]
    ages = ((-1, False), (0, True), (stale_us, True), (stale_us + 1, False))
    for age, good in ages:
        state = State(FRESH.values, (*FRESH.ages[:slot], age, *FRESH.ages[slot + 1 :]))
        assert values_of(state) == [*usual[:slot], usual[slot] if good else MISSING, *usual[slot + 1 :]], age
    given = ((None, False), (-most - 1, False), (-most, True), (most, True), (most + 1, False))
    for value, good in given:
        state = State((*FRESH.values[:slot], value, *FRESH.values[slot + 1 :]), FRESH.ages)
        assert values_of(state) == [*usual[:slot], known(value) if good else MISSING, *usual[slot + 1 :]], value


@rows(
    "values, ages", [((), ()), (FRESH.values, FRESH.ages[1:]), (FRESH.values[1:], FRESH.ages), (FRESH.values * 2,) * 2]
)
def test_state_of_wrong_size_is_all_missing(values: tuple[int, ...], ages: tuple[int, ...]) -> None:
    assert values_of(State(values, ages)) == [MISSING for _ in SLOTS]
