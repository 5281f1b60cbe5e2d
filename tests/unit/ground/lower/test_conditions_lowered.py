"""The code of lowered conditions: integer factors, shared monitors, phases, and the safe side of a zone."""

from pathlib import Path

import pytest

from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.ground.language.load import load
from rtshcua.ground.lower.conditions import CodeWriter
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import MonitorKind, Policy
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]

SOURCE = """
import "lib:policies/site.rts"
import "lib:skills/signals.rts"
import "lib:skills/emergency_land.rts"

skill probe(up: altitude in -100 m .. 100 m, pace: speed in 1 m/s .. 8 m/s) {
  motion   hold
  class    tactical
  deadline 5 s
  valid    for 40 min
  lasts    at most 1 min
  maintain CONDITION
  fallback emergency_land
  energy   at most 5 %
}

policy rules version 1 {
  permit probe by role operator when RULE
  permit emergency_land by any
  contingency emergency_land
}

mission m under rules@1 on surveyor {
  proposed by operator x for role operator
  phase a { STEP }
}
"""
LAND = "emergency_land()"


def compiled(condition: str, rule: str = "up < 90 m", step: str = LAND) -> Compiled:
    text = SOURCE.replace("CONDITION", condition).replace("RULE", rule).replace("STEP", step)
    program = load(["x.rts"], lambda path: text.encode() if path == "x.rts" else Path(path).read_bytes(), str(CHECKOUT))
    return compile_program(program, dialect.load(), mission=None, issued_at_us=0)


def lowered(condition: str) -> tuple[Policy, Contract]:
    """Compile a policy with a condition, check that it loads, and return it with its skill's contract."""
    found = compiled(condition)
    assert found.policy is not None, found.diagnostics
    assert isinstance(prepare(found.policy), PreparedPolicy)
    return found.policy, next(contract for contract in found.policy.contracts if contract.name == "probe")


def shown(code: tuple[int, ...], policy: Policy) -> str:
    """Format code as names of signals, numbers and operations."""
    names = {signal.slot: signal.name for signal in policy.signals}
    words = []
    for op, a, b in zip(code[::3], code[1::3], code[2::3], strict=True):
        match op:
            case Op.SIGNAL:
                words.append(names[a])
            case Op.ARGUMENT:
                words.append(("up", "pace")[a])
            case Op.CONST:
                words.append(str(a))
            case Op.SCALE:
                words.append(f"*{a}")
            case Op.PHASE_IN:
                words.append("phase{" + ",".join(policy.phases[member] for member in policy.sets[b]) + "}")
            case Op.TIME_IN:
                words.append(f"local[{a},{b}]")
            case Op.WEEK_IN:
                words.append(f"week{policy.sets[a]}")
            case Op.MONITOR:
                words.append(f"monitor{a}")
            case Op.POSITION_IN:
                words.append(f"in({policy.zones[a].name})")
            case _:
                words.append(Op(op).name)
    return " ".join(words)


H = 3_600_000_000  # us
NOONS = tuple(24 * H * day + time for day in (0, 4, 5, 6) for time in (12 * H, 13 * H + 1))

CODE = [
    ("local time in 08:00 .. 18:00 on monday, tuesday", f"week{(8 * H, 18 * H + 1, 32 * H, 42 * H + 1)}"),
    ("local time on saturday, sunday", f"week{(120 * H, 168 * H)}"),
    ("local time in 22:00 .. 06:00 on sunday", f"week{(0, 6 * H + 1, 166 * H, 168 * H)}"),
    (
        "local time in 12:00 .. 13:00 on friday .. monday",
        f"week{NOONS}",
    ),
    ("local time on monday .. sunday", f"local[0,{24 * H}]"),
    ("height < 20 m", "height 20000 LT"),
    ("height <= up + 5 m", "height up 5000 ADD LE"),
    ("height < 10 m / 3", "height *3 10000 LT"),
    ("2 * height < 40 m", "height 20000 LT"),
    ("obstacle.distance > wind.speed * 1500 ms", "obstacle.distance *2 wind.speed *3 GT"),
    ("obstacle.distance / 4 s < pace", "obstacle.distance pace *4 LT"),
    ("battery / 2 > 20 % / 3", "battery *3 4000 GT"),
    ("obstacle.distance / 2 m != 1 / 3", "obstacle.distance *3 2000 NE"),
    ("height - height == 0 m", "height *0 0 EQ"),
    ("-2 * height < 3 m", "height *-1 1500 LT"),
    ("max(height, up) <= 5 m", "height 5000 LE up 5000 LE AND"),
    ("max(height, up) > 5 m", "height 5000 GT up 5000 GT OR"),
    ("min(height, up) <= 5 m", "height 5000 LE up 5000 LE OR"),
    ("5 m > min(height, up)", "height *-1 -5000 GT up *-1 -5000 GT OR"),
    ("abs(height - up) < 5 m", "height up *-1 ADD 5000 LT height *-1 up ADD 5000 LT AND"),
    ("max(height, up) == 5 m", "height 5000 LE up 5000 LE AND height 5000 GE up 5000 GE OR AND"),
    ("max(height, up) != 5 m", "height 5000 LT up 5000 LT AND height 5000 GT up 5000 GT OR OR"),
    ("max(5 m, 3 m) < height", "5000 height LT"),
    ("height in 10 m / 3 .. up", "height *3 10000 GE height up LE AND"),
    ("phase == inspection", "phase{inspection}"),
    ("phase != inspection", "phase{inspection} NOT"),
    ("local time >= 19:00", f"local[{19 * H},{24 * H}]"),
    ("19:00 < local time", f"local[{19 * H + 1},{24 * H}]"),
    ("local time <= 00:00", "local[0,0]"),
    ("19:00 > local time", f"local[0,{19 * H - 1}]"),
    ("local time < 00:00 or battery > 30 %", f"local[0,{24 * H}] NOT battery 3000 GT OR"),
    ("phase in {departure, a}", "phase{departure,a}"),
    ("battery > 30 % for the last 3 s", "monitor0"),
    (
        "battery > 30 % within 5 s of height > 3 m",
        "battery 3000 GT monitor0 AND height 3000 GT monitor1 AND OR",
    ),
]


@rows(("condition", "code"), CODE)
def test_conditions_are_lowered_to_the_expected_code(condition: str, code: str) -> None:
    policy, contract = lowered(condition)
    (clause,) = contract.maintain
    assert shown(clause.code, policy) == code


def monitors(policy: Policy) -> list[tuple[str, int, str, str]]:
    return [
        (MonitorKind(each.kind).name, each.window_us, shown(each.when.code, policy), each.when.text)
        for each in policy.monitors
    ]


def test_nested_monitors_come_first_and_are_shared() -> None:
    policy, contract = lowered(
        "(battery > 30 % for the last 3 s) within the last 5 s"
        " and (battery > 1 m / 1 m * 30 % for the last 3000 ms or rising height > 3 m)"
    )
    assert [shown(clause.code, policy) for clause in contract.maintain] == ["monitor1", "monitor0 monitor2 OR"]
    assert monitors(policy) == [
        ("FOR_LAST", 3_000_000, "battery 3000 GT", "battery > 30 %"),
        ("WITHIN_LAST", 5_000_000, "monitor0", "battery > 30 % for the last 3 s"),
        ("RISING", 0, "height 3000 GT", "height > 3 m"),
    ]


def test_rules_and_skills_share_monitors() -> None:
    condition = "battery > 30 % for the last 3 s"
    found = compiled(condition, f"{condition} and falling battery > 30 %")
    assert found.policy is not None
    assert [MonitorKind(each.kind) for each in found.policy.monitors] == [MonitorKind.FOR_LAST, MonitorKind.FALLING]


def test_contract_reads_the_slots_of_its_monitors() -> None:
    policy, contract = lowered("(wind.speed < 5 m/s for the last 3 s) within the last 5 s")
    slots = {signal.name: signal.slot for signal in policy.signals}
    assert contract.reads == (slots["wind.speed"],)


def test_monitor_keeps_the_safe_side_of_a_zone() -> None:
    inside = "position inside grow(bridge_a, 20 m)"
    policy, _ = lowered(
        f"({inside} for the last 3 s) or not ({inside} for the last 3 s) or not (not ({inside}) within the last 3 s)"
    )
    zones = [policy.zones[monitor.when.code[1]] for monitor in policy.monitors]
    assert [zone.name for zone in zones] == ["grow(bridge_a, 20 m)"] * 3
    assert zones[0].data == zones[2].data  # it must hold: rounded inwards
    assert zones[0].data != zones[1].data  # it must not: rounded outwards


def distinct(number: int) -> str:
    return " and ".join(f"(battery > 30 % for the last {each} s)" for each in range(1, number + 1))


def test_number_of_monitors_is_limited() -> None:
    policy, _ = lowered(distinct(32))
    assert len(policy.monitors) == 32
    found = compiled(distinct(33))
    assert found.policy is None
    assert [each.code.id for each in found.diagnostics] == ["E1001"]


TOO_LARGE = [
    ("height < " + " + ".join(["max(0 m, gps.accuracy, obstacle.distance)"] * 5) + " + up", "E1002"),
    ("max(" + ", ".join(["height"] * 129) + ") < 3 m", "E1002"),
    ("obstacle.distance < wind.speed * 333333 us", "E1003"),
    ("max(height, up) < up + gps.accuracy * 512", "E1003"),
    ("height * 2 < 9100000000000 * 1 m + up", "E1003"),
    ("(wind.speed < 513 * wind.speed + 1 m/s) for the last 3 s", "E1003"),
]


@rows(("condition", "code"), TOO_LARGE)
def test_condition_that_does_not_fit_on_board_is_reported(condition: str, code: str) -> None:
    assert {each.code.id for each in compiled(condition).diagnostics} == {code}


def test_nearest_accepted_argument_is_found_through_functions() -> None:
    found = compiled(
        "battery > 5 %", "abs(up - 10 m) <= 5 m and min(pace, 3 m/s) > 2 m/s", "probe(up = 30 m, pace = 4 m/s)"
    )
    (finding,) = found.diagnostics
    assert finding.code.id == "E0703"
    assert finding.help == "nearest accepted: `up = 15 m`"


AUTHORITY = [
    ("phase == a", []),
    ("phase in {b, c}", ["E0703"]),
    ("phase != a", ["E0703"]),
    ("battery > 50 % for the last 3 s and rising height > 3 m", ["E0717"]),  # the first step, which does not wait
    ("battery > 50 % within 3 s of height > 3 m and up < 20 m", ["E0703"]),
]


@pytest.mark.parametrize(("rule", "codes"), AUTHORITY)
def test_permit_proof_ignores_temporal_conditions(rule: str, codes: list[str]) -> None:
    found = compiled("battery > 5 %", rule, "probe(up = 30 m, pace = 4 m/s)")
    assert [each.code.id for each in found.diagnostics if each.code.id.startswith("E07")] == codes


def test_factors_beyond_the_range_of_numbers_are_reported() -> None:
    (found,) = compiled("obstacle.distance < wind.speed * 333 ms").diagnostics
    assert found.code.id == "E1003"
    assert found.help == "as integers, its factors add up to 1,333, but at most 512 fit; use rounder factors"


def test_stack_depth_counts_every_atom() -> None:
    code = CodeWriter()
    for op in (Op.WEEK_IN, Op.TIME_IN, Op.PHASE_IN, Op.MONITOR, Op.KNOWN):
        code.add(op)
    assert code.deepest == 5
