import re
import statistics
import time
from math import nan
from pathlib import Path
from typing import Any

import msgspec
import pytest

from reference.gateway_world import (
    MORNING,
    GatewayWorld,
    acks,
    command_int,
    command_long,
    policy,
    proposals,
    reposition,
    setpoint,
    texts,
)
from reference.sources import CHECKOUT
from rtshcua.decision.decide import decide
from rtshcua.ground.analysis.plane import nearest_inside
from rtshcua.ground.gateway import quick_decision
from rtshcua.model.flat.zone import CIRCLE
from virtual.gateway_clients import POLICY

SCHOOL = {"latitude": 473_972_900, "longitude": 85_477_100}
ABROAD = {"latitude": 473_990_000, "longitude": 85_700_000}


def aloft(**settings: str) -> GatewayWorld:
    world = GatewayWorld()
    world.client(1, "script", **settings)
    world.fly()
    return world


def test_each_refusal_has_a_result_and_a_text_with_the_limit() -> None:
    """By hand: the result, and what the client's screen shows."""
    low, dark, gone = aloft(), aloft(), aloft()
    low.signals["battery"] = (2_000,)
    dark.signals["battery.cell"] = (3_100,)
    del gone.signals["gps.fix"]
    nobody, stranger = aloft(role="trainee"), aloft(role="postman")
    table = (
        (aloft(), reposition(z=550), 2, "goto denied: altitude 62 m, accepted 40 m (integrity/argument-out-of-range)"),
        (aloft(), reposition(z=533), 2, "goto denied: altitude 45 m, accepted 40 m (authority/out-of-scope)"),
        (aloft(), reposition(z=490), 2, "goto denied: altitude 2 m, accepted 5 m (integrity/argument-out-of-range)"),
        (aloft(), reposition(**ABROAD), 2, "8.5514068 E (authority/out-of-scope)"),
        (aloft(), reposition(**SCHOOL), 2, "by any when target inside grow(school, 20 m) (authority/forbidden)"),
        (low, reposition(), 1, "goto rejected: battery 20 %, accepted 30.01 % (state/violated)"),
        (gone, reposition(), 1, "goto rejected: gps.fix unknown; gps.fix >= fix_3d (state/unknown)"),
        (dark, reposition(), 1, "goto rejected: battery.cell 3.1 V, accepted 3.5 V (safety/degraded)"),
        (nobody, reposition(), 2, "goto denied: no rule of bridge_inspection names the role trainee"),
        (stranger, reposition(), 2, "goto denied: no rule of bridge_inspection names the role postman"),
    )  # fmt: skip
    for world, message, result, text in table:
        actions = world.send(message)
        assert proposals(actions) == [], text
        assert acks(actions) == [(192, result)], text
        (said,) = texts(actions)
        assert said.endswith(text), said


def test_a_refused_target_says_which_conditions_failed_and_the_nearest_accepted_values() -> None:
    """By hand: height above sea, and what fails besides the target. The named values are then accepted."""
    for z, besides in ((508.0, ""), (533.0, "; altitude 45 m, accepted 40 m")):
        world = aloft()
        (said,) = texts(world.send(reposition(**ABROAD, z=z)))
        found = re.fullmatch(
            r"goto denied: target outside city, nearest accepted ([0-9.]+) N, ([0-9.]+) E(.*) \(authority/.*\)", said
        )
        assert found, said
        assert found[3] == besides
        place = {"latitude": round(float(found[1]) * 1e7), "longitude": round(float(found[2]) * 1e7)}
        assert [skill for skill, *_ in proposals(world.send(reposition(**place, z=min(z, 528.0))))] == ["goto"]


def test_a_target_in_an_area_without_room_is_refused_without_a_nearest_one() -> None:
    world = aloft()
    flat = world.policy.policy
    city = next(number for number, each in enumerate(flat.zones) if each.name == "city")
    tiny = msgspec.structs.replace(flat.zones[city], shape=CIRCLE, data=(0, 0, 500 * 500))
    assert nearest_inside(tiny, (9_000, 0), 1_000) is None
    assert nearest_inside(tiny, (9_000, 0), 100) == (400, 0)


@pytest.mark.parametrize(
    ("wind", "text"),
    [
        ((3_000,), "goto denied: wind.speed 3 m/s, accepted 0.999 m/s (authority/out-of-scope)"),
        ((), "goto denied: wind.speed unknown, accepted 0.999 m/s (authority/out-of-scope)"),
    ],
)
def test_wind_that_is_measured_is_told_with_its_limit(wind: tuple[int, ...], text: str, tmp_path: Path) -> None:
    """The policy of the tests with programs of others, whose vehicles know no wind on the ground."""
    (tmp_path / "rules.rts").write_text(POLICY.replace("HOUR", "10"))
    world = GatewayWorld(under=policy(tmp_path / "rules.rts"))
    world.client(1, "script", role="wind")
    world.fly()
    world.signals["wind.speed"] = wind
    (said,) = texts(world.send(reposition()))
    assert said == text
    world.signals["wind.speed"] = (500,)
    assert texts(world.send(reposition())) == []


def test_a_role_that_may_not_is_named() -> None:
    world = GatewayWorld(under=policy(CHECKOUT / "policies" / "training_field.rts"))
    world.client(1, "script", role="supervisor")
    world.fly()
    (said,) = texts(world.send(reposition()))
    assert said.startswith("goto denied: ")


def test_a_path_out_of_the_airspace_names_the_zone() -> None:
    world = aloft()
    world.signals["position"] = (450_000, -150_000)
    (said,) = texts(world.send(reposition()))
    assert said == "goto rejected: leaves city; enters school; airspace inside city outside school (safety/airspace)"


def test_the_height_of_the_vehicle_is_no_reason_to_climb() -> None:
    world = GatewayWorld()
    world.ready()
    world.signals["landed"] = (2,)
    (said,) = texts(world.send(command_long(22, 0, 0, 0, 0, 0, 0, 503)))
    assert said == "takeoff rejected: landed in_air, accepted on_ground (state/violated)"


def test_a_skill_that_the_role_may_not_use_is_denied() -> None:
    world = GatewayWorld()
    world.client(1, "script", role="supervisor")
    world.fly()
    (said,) = texts(world.send(reposition()))
    assert said == "goto denied: the role supervisor may not (authority/not-permitted)"


def test_a_place_beyond_any_plan_is_malformed() -> None:
    world = GatewayWorld()
    world.fly()
    actions = world.send(command_int(192, 6, 0, 1, x=473_983_000, y=85_455_900, z=3e6))
    assert acks(actions) == [(192, 2)]
    (said,) = texts(actions)
    assert said.startswith("goto denied: plan: altitude ")


def test_an_unknown_charge_is_named_where_the_way_home_needs_it() -> None:
    world = aloft()
    del world.signals["battery"]
    assert texts(world.send(command_long(193, 0))) == ["hover rejected: battery unknown (safety/unknown)"]


def test_an_unknown_place_is_named_where_no_clause_is() -> None:
    world = aloft()
    del world.signals["position"]
    (said,) = texts(world.send(command_long(20)))
    assert said.endswith(("(safety/unknown)", "(state/unknown)"))
    assert "unknown" in said


TIMED = """import "lib:policies/site.rts"
import "lib:skills/hover.rts"
import "lib:skills/goto.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
import "lib:skills/takeoff.rts"

policy timed version 1 {
  permit takeoff by role operator through agent when local time in 08:00 .. 18:00
  permit goto by role operator through agent when height > 5 m for the last 2 s
  permit hover, return_home, emergency_land by any
  confirm takeoff by role supervisor within 30 s
  contingency return_home, emergency_land
}
"""


@pytest.fixture(scope="module")
def timed(tmp_path_factory: pytest.TempPathFactory) -> GatewayWorld:
    path = tmp_path_factory.mktemp("policies") / "timed.rts"
    path.write_text(TIMED)
    return GatewayWorld(under=policy(path))


def test_the_time_of_day_is_told(timed: GatewayWorld) -> None:
    timed.ready()
    timed.utc_us = MORNING + 10 * 3_600_000_000
    (said,) = texts(timed.send(command_long(22, 0, 0, 0, 0, 0, 0, 503)))
    timed.utc_us = MORNING
    assert said == "takeoff denied: time 22:00, accepted 18:00 (authority/out-of-scope)"


def test_what_a_monitor_may_let_pass_is_decided_on_board(timed: GatewayWorld) -> None:
    timed.fly()
    assert proposals(timed.send(reposition())) != []
    timed.signals["battery"] = (2_000,)
    actions = timed.send(reposition(z=509))
    timed.signals["battery"] = (9_000,)
    assert acks(actions) == [(192, 2)], "refused whatever the monitor says"


def test_a_step_that_needs_an_approval_is_proposed(timed: GatewayWorld) -> None:
    timed.line(type="close", ending="completed")
    timed.signals |= {"height": (0,), "landed": (1,)}
    timed.report(armed=False, airborne=False)
    timed.ready()
    actions = timed.send(command_long(22, 0, 0, 0, 0, 0, 0, 503))
    assert [skill for skill, *_ in proposals(actions)] == ["takeoff"]


@pytest.mark.slow
def test_a_refusal_takes_about_a_millisecond_or_less() -> None:
    """The median, with a wide margin: figures are in bench/gateway.py."""
    world = aloft()
    times = []
    for number in range(200):
        world.now_us += 1_000
        begun = time.perf_counter()
        world.send(reposition(z=540 + number % 7))
        times.append(time.perf_counter() - begun)
    assert statistics.median(times) < 0.02


# ---------------------------------------------------------------- floods


def flooded(monkeypatch: pytest.MonkeyPatch, world: GatewayWorld, messages: list[Any]) -> tuple[int, int, int]:
    """Send 800 commands in a second by four connections; how many were decided, answered and told in a text."""
    decided = 0

    def counted(*words: Any) -> Any:
        nonlocal decided
        decided += 1
        return decide(*words)

    monkeypatch.setattr(quick_decision, "decide", counted)
    answered = said = 0
    for at in range(800):
        world.now_us += 1_250
        actions = world.send(messages[at % len(messages)], 1 + at % 4)
        answered += len(acks(actions, 1 + at % 4))
        said += len(texts(actions, 1 + at % 4))
    return decided, answered, said


def of_four() -> GatewayWorld:
    world = GatewayWorld()
    for number in (2, 3, 4):
        world.client(number, "script")
    return world


def test_a_flood_of_one_refused_command_is_decided_a_few_times_and_answered_each_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """MAVSDK leaves parameters NaN. A decision is made again after 200 ms; each moves its value once or twice."""
    for message, ready in ((reposition(z=550), False), (command_long(400, 1, nan), True), (command_long(21), True)):
        world = of_four()
        world.signals["battery"] = (3_000,)
        if ready:
            world.ready()
        else:
            world.fly()
        decided, answered, said = flooded(monkeypatch, world, [message])
        assert answered == 800
        assert decided <= 100, message
        assert said <= 24, message


def test_a_flood_of_similar_commands_leaves_room_to_land(monkeypatch: pytest.MonkeyPatch) -> None:
    world = of_four()
    world.fly()
    decided, answered, said = flooded(monkeypatch, world, [reposition(z=550 + at / 10) for at in range(400)])
    assert (answered, decided <= 100) == (800, True), decided
    assert said <= 48
    assert texts(world.done)[-1] == "too many commands: at most 20 a second are decided"
    assert [skill for skill, *_ in proposals(world.send(command_long(21), 2))] == ["emergency_land"]
    world.wait(1_100_000)
    assert [skill for skill, *_ in proposals(world.send(reposition(), 3))] == ["goto"]


def test_a_flood_of_refused_setpoints_is_decided_a_few_times(monkeypatch: pytest.MonkeyPatch) -> None:
    world = of_four()
    world.fly()
    world.offboard()
    decided, *_ = flooded(monkeypatch, world, [setpoint(z=80 + at / 10) for at in range(100)])
    assert decided <= 100, decided


def test_a_refusal_is_decided_again_once_the_vehicle_has_changed() -> None:
    world = GatewayWorld()
    assert acks(world.send(command_long(300))) == [(300, 1)]
    assert texts(world.send(command_long(300))) == []
    world.now_us += 200_000
    assert texts(world.send(command_long(193, 0))) == ["hover rejected: the vehicle is on the ground: take off first"]
    world.fly()
    assert len(proposals(world.send(command_long(193, 0)))) == 1, "at once"
