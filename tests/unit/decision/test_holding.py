"""The conditions that prevent waiting in the air."""

from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import POLICY, STEP, loaded, ready
from reference.flat_case import BATTERY, HEIGHT, NOW, POSITION_X, POSITION_Y, M
from rtshcua.decision.running_conditions import WAY_HOME, holding
from rtshcua.decision.values import FALSE, UNKNOWN
from virtual.rows import rows

DEGRADE = flat.RULES[-1].text
AIRSPACE = "airspace inside city outside school"
AWAY: dict[int, int | None] = {POSITION_X: 300 * M, POSITION_Y: 0}
#: 300 m at 12 m/s are 25 s of 18 minutes: 231.5 of 10000, rounded up, beside a reserve of 1000
ENOUGH = 1_232


@rows(
    ("values", "unkept"),
    [
        ({}, []),
        ({BATTERY: 2_499}, [(DEGRADE, FALSE)]),
        ({BATTERY: ENOUGH, **AWAY}, [(DEGRADE, FALSE)]),
        ({BATTERY: ENOUGH - 1, **AWAY}, [(DEGRADE, FALSE), (WAY_HOME, FALSE)]),
        ({BATTERY: None}, [(DEGRADE, UNKNOWN), (WAY_HOME, UNKNOWN)]),
        ({POSITION_X: None}, [(AIRSPACE, UNKNOWN), (WAY_HOME, UNKNOWN)]),
        ({HEIGHT: None}, [(AIRSPACE, UNKNOWN)]),  # the city has a ceiling
        ({HEIGHT: None, POSITION_X: 600 * M}, [(AIRSPACE, FALSE)]),
        ({POSITION_X: 600 * M}, [(AIRSPACE, FALSE)]),
    ],
)
def test_holding(values: dict[int, int | None], unkept: list[tuple[str, int]]) -> None:
    assert list(holding(ready(STEP, POLICY), flat.state(values), POLICY, NOW)) == unkept


def test_hold_never_leaves_a_missing_airspace() -> None:
    policy = loaded(replace(flat.POLICY, airspace=None))
    assert holding(ready(STEP, policy), flat.state({POSITION_X: 600 * M}), policy, NOW) == ()
