"""The choice of links, and the conditions that are watched while a skill runs."""

from typing import Any

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import POLICY, STEP, loaded, ready, with_rules
from reference.flat_case import BATTERY, FIX, HEIGHT, HOME, HOVER, LAND, LINK, NOW, POSITION_X, POSITION_Y, WIND, M, S
from rtshcua.decision.fallbacks import DEGRADE, START, choose_contingency, choose_fallback, fallbacks, link_admissible
from rtshcua.decision.running_conditions import WAY_HOME, watch
from rtshcua.decision.values import FALSE, MISSING, UNKNOWN, Sets, interval, maybe, point
from rtshcua.model.flat.policy import RuleKind
from virtual.rows import rows

INSPECTION = ready(STEP, POLICY)


def chosen(values: dict[int, int | None], after: int = START, policy: Any = POLICY) -> tuple[int, int] | None:
    choice = choose_fallback(ready(STEP, policy), flat.state(values), policy, NOW, after)
    return None if choice is None else (choice.index, choice.link.skill)


@rows(
    ("values", "after", "choice"),
    [
        ({}, START, (0, HOVER)),
        ({}, DEGRADE, (0, HOVER)),
        ({}, 0, (1, HOME)),
        ({}, 1, (2, LAND)),
        ({}, 2, None),
        ({}, 99, None),
        ({FIX: 2}, START, (2, LAND)),  # hover and return need a fix
        ({FIX: None}, START, (2, LAND)),  # unknown is not true
        ({BATTERY: 2_000}, START, (DEGRADE, HOME)),
        ({BATTERY: 2_000}, DEGRADE, (0, HOVER)),  # the degrade rule's link failed: on along the chain
        ({BATTERY: 2_000, FIX: 2}, START, (2, LAND)),
        ({BATTERY: None}, START, (0, HOVER)),
    ],
)
def test_fallback(values: dict[int, int | None], after: int, choice: tuple[int, int] | None) -> None:
    assert chosen(values, after) == choice


@pytest.mark.parametrize(
    ("values", "after", "choice"),
    [({}, START, 0), ({}, 0, 1), ({BATTERY: 2_000}, START, 0), ({FIX: 2}, START, 2), ({}, 2, None)],
)
def test_contingency(values: dict[int, int | None], after: int, choice: int | None) -> None:
    found = choose_contingency(flat.state(values), POLICY, NOW, after)
    assert (found and found.index) == choice
    assert found is None or found.link is flat.POLICY.contingency[found.index]


@rows(
    ("values", "home"),
    [
        ({}, True),
        ({POSITION_X: 0, POSITION_Y: 450 * M}, False),  # the school lies between here and home
        ({POSITION_X: 0, POSITION_Y: 300 * M}, True),  # in the school already
        ({POSITION_X: 0, POSITION_Y: 402 * M}, True),  # in it as far as the position error tells
        ({POSITION_X: 0, POSITION_Y: 405 * M}, False),
        ({POSITION_X: 600 * M}, True),  # out of the city: come back
        ({HEIGHT: 130 * M}, True),  # above the ceiling
        ({POSITION_X: None}, False),  # whether this leads into the school is unknown, so it does not fly
    ],
)
def test_going_home_and_breaches(values: dict[int, int | None], home: bool) -> None:
    hover, come_home, land = (link_admissible(link, flat.state(values), POLICY, NOW) for link in POLICY.contingency)
    assert (hover, come_home, land) == (True, home, True)


def test_a_link_that_flies_elsewhere_keeps_to_the_airspace() -> None:
    links = (
        flat.link(flat.TAKEOFF, 60 * M),
        flat.link(flat.GOTO, 0, 300 * M, 20 * M),
        flat.link(flat.GOTO, 0, 0, 20 * M),
    )
    low = replace(flat.ZONES[0], ceiling=50 * M)
    policy = loaded(replace(flat.POLICY, contingency=links, zones=(low, *flat.ZONES[1:])))
    admissible = [link_admissible(link, flat.state(), policy, NOW) for link in policy.contingency]
    assert admissible == [False, False, True]
    anywhere = loaded(replace(flat.POLICY, contingency=links, airspace=None))
    assert all(link_admissible(link, flat.state(), anywhere, NOW) for link in anywhere.contingency)


def test_an_invalid_zone_argument_is_unknown() -> None:
    near = flat.clause("position inside area", (29, 0, 0))
    rules = (flat.rule(RuleKind.DEGRADE, flat.INSPECT, when=near, target=flat.link(HOME)),)
    policy = loaded(replace(flat.POLICY, rules=rules))
    for area, index in ((flat.BRIDGE, DEGRADE), (flat.SCHOOL, 0), (-1, 0), (9, 0)):
        plan = replace(STEP.plan, path=(0, 300 * M)) if area == flat.SCHOOL else STEP.plan
        invocation = ready(replace(STEP, arguments=(area, 20 * M, 0, 4 * M), plan=plan), policy)
        choice = choose_fallback(invocation, flat.state(), policy, NOW)
        assert choice is not None
        assert choice.index == index


def sets(values: dict[int, Any]) -> Sets:
    nominal = [values.get(slot, point(flat.NOMINAL[slot])) for slot in range(flat.SLOTS)]
    return Sets(nominal, (NOW.monotonic_us,) * 2, ((NOW.utc_us,) * 2,), (0, 0))


@pytest.mark.parametrize(
    ("values", "choices"),
    [
        ({}, [0]),
        ({BATTERY: interval(2_000, 3_000)}, [DEGRADE, 0]),
        ({BATTERY: point(2_000), FIX: maybe(point(3))}, [DEGRADE, 0, 1, 2]),
        ({FIX: MISSING}, [2]),
        ({POSITION_Y: interval(200 * M, 450 * M), BATTERY: point(2_000)}, [DEGRADE, 0]),
    ],
)
def test_the_links_that_sets_may_choose(values: dict[int, Any], choices: list[int]) -> None:
    found = [c and c.index for c in fallbacks(INSPECTION, sets(values), POLICY, START, exact=False)]
    assert found == choices


def test_no_link_at_all() -> None:
    policy = loaded(replace(flat.POLICY, contingency=()))
    assert choose_contingency(flat.state(), policy, NOW) is None


# ------------------------------------------------------------------------------------------------------- watch


def broken(values: dict[int, int | None], policy: Any = POLICY, **given: Any) -> list[tuple[str, int]]:
    found = watch(ready(STEP, policy), flat.state(values, **given), policy, NOW)
    return [(one.text, one.truth) for one in found]


NEAR, LOW = "position inside grow(area, 15 m)", "height <= altitude + 5 m"
DEGRADE_TEXT, AIRSPACE_TEXT = flat.RULES[6].text, "airspace inside city outside school"


@rows(
    ("values", "found"),
    [
        ({}, []),
        ({LINK: 100}, [("link.quality >= 40 %", FALSE)]),
        ({WIND: None}, [("wind.speed < 10 m/s", UNKNOWN)]),
        ({BATTERY: 3_000}, []),  # `require` counts at dispatch only
        ({HEIGHT: 26 * M}, [("height <= altitude + 5 m", FALSE)]),
        ({POSITION_X: 88 * M}, [("position inside grow(area, 15 m)", FALSE)]),  # within the position error
        ({POSITION_X: 88 * M + 1}, []),  # where it is, not where it may go
        ({POSITION_X: 600 * M}, [("position inside grow(area, 15 m)", FALSE), (AIRSPACE_TEXT, FALSE)]),
        ({BATTERY: 2_000}, [(DEGRADE_TEXT, FALSE)]),
        ({BATTERY: 1_086}, [(DEGRADE_TEXT, FALSE), (WAY_HOME, FALSE)]),  # 111.8 m are 86.3 of 10000, beside 1000
        ({BATTERY: 1_087}, [(DEGRADE_TEXT, FALSE)]),
        ({BATTERY: None}, [(DEGRADE_TEXT, UNKNOWN), (WAY_HOME, UNKNOWN)]),
        (
            {POSITION_X: None, HEIGHT: 26 * M},  # too high, wherever it is
            [(NEAR, UNKNOWN), (LOW, FALSE), (AIRSPACE_TEXT, UNKNOWN), (WAY_HOME, UNKNOWN)],
        ),
    ],
)
def test_watch(values: dict[int, int | None], found: list[tuple[str, int]]) -> None:
    assert broken(values) == found


def test_return_and_landing_need_no_charge_for_way_home() -> None:
    for step, needs in ((STEP, True), (flat.INVOCATIONS[-1], False)):
        found = watch(ready(step, POLICY), flat.state({BATTERY: 100}), POLICY, NOW)
        assert ((WAY_HOME, FALSE) in found) is needs


def test_watch_reports_stale_signal() -> None:
    names = [text for text, truth in broken({}, ages={POSITION_X: S}) if truth == UNKNOWN]
    assert names == [NEAR, LOW, AIRSPACE_TEXT, WAY_HOME]


def test_watch_without_airspace_and_degrade() -> None:
    policy = with_rules(flat.rule(RuleKind.PERMIT))
    policy = loaded(replace(policy.policy, airspace=None))
    assert broken({BATTERY: 2_000, POSITION_X: 600 * M}, policy) == [("position inside grow(area, 15 m)", FALSE)]
