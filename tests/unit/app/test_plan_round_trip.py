"""A mission that is exported as a plan and imported again flies the same legs."""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from reference.exported_flight import export_of, run_in
from reference.qgc_plans import HOME, RETURN, TAKEOFF, fence, plan, write
from rtshcua.app.flights import flight_export
from rtshcua.app.importing import ImportedSource, ImportRequest, import_file
from rtshcua.app.programs import compile_reading, read_sources, read_text
from rtshcua.ground.flight.export.exported import FlightExport
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy

CHECKOUT = Path(__file__).resolve().parents[3]
ISSUED = 1_780_000_000_000_000
#: a mission with a survey, waits and a change of speed
SHIPPED = CHECKOUT / "missions/extended.rts"
BRIDGES = CHECKOUT / "policies/bridge_inspection.rts"


class Leg(NamedTuple):
    """A corner of the path, with the speed towards it; or a wait there, us; or the end of the flight."""

    place: tuple[int, int]
    height: int
    speed: int
    wait: int
    end: int


def legs(mission: Mission) -> list[Leg]:
    """The legs of a mission, without those that lead nowhere."""
    found: list[Leg] = []
    place, height = (0, 0), 0
    for step in mission.invocations:
        kind = step.plan.kind
        if kind in (MotionKind.CLIMB, MotionKind.FLY, MotionKind.COVER):
            corners = list(zip(step.plan.path[::2], step.plan.path[1::2], strict=True)) or [place]
            for corner in corners:
                if (corner, step.plan.altitude) != (place, height):
                    found.append(Leg(corner, step.plan.altitude, step.plan.speed, 0, -1))
                place, height = corner, step.plan.altitude
        elif kind == MotionKind.HOLD:
            found.append(Leg(place, height, 0, step.arguments[step.contract.motion.time], -1))
        else:
            place, height = (0, 0) if kind == MotionKind.HOME else place, 0
            found.append(Leg(place, 0, 0, 0, kind))
    return found


def same(one: list[Leg], other: list[Leg]) -> bool:
    """Whether legs are the same; a place is rounded to 1e-7 degree, at most 6 mm away on either axis."""
    return len(one) == len(other) and all(
        max(abs(a - b) for a, b in zip(x.place, y.place, strict=True)) <= 12 and x[1:] == y[1:]
        for x, y in zip(one, other, strict=True)
    )


@cache
def exported() -> FlightExport:
    folder = Path("run").resolve()
    return export_of(run_in(folder))


def round_trip(policy: Policy, mission: Mission, source: Path) -> Mission:
    """The mission, exported as a plan and imported under the same policy."""
    path = Path("again.plan")
    path.write_bytes(_plan_of(policy, mission))
    found = import_file(ImportRequest(path, policy=source, proposer="agent"))
    assert isinstance(found, ImportedSource), found
    assert not found.not_kept
    again = compile_reading(read_text("again.rts", found.text), mission=None, issued_at_us=ISSUED)
    assert again.planned is not None, again.diagnostics
    return again.planned.mission


def _plan_of(policy: Policy, mission: Mission) -> bytes:
    export = exported()
    flight = export.flight._replace(policy=policy, mission=mission, telemetry=None)
    return flight_export._plan(export._replace(flight=flight)).data


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_shipped_mission_comes_back_with_the_same_legs() -> None:
    compiled = compile_reading(read_sources([SHIPPED]), mission=None, issued_at_us=ISSUED)
    assert compiled.policy is not None
    assert compiled.mission is not None
    again = round_trip(compiled.policy, compiled.mission, BRIDGES)
    assert same(legs(again), legs(compiled.mission))
    assert len(again.invocations) > len(compiled.mission.invocations), "a survey comes back as its legs"


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("goto"), st.integers(-900, 900), st.integers(-900, 900), st.integers(5_000, 20_000),
                  st.integers(1_000, 8_000)),
        st.tuples(st.just("hover"), st.integers(1_000, 25_000)),
    ),
    min_size=1, max_size=6,
)  # fmt: skip


def source_of(steps: list[tuple[int | str, ...]], last: str, header: str) -> str:
    """A mission with these steps; places are in 1e-6 degree from home."""
    lines = []
    for step in steps:
        if step[0] == "hover":
            lines.append(f"hover({step[1]} ms)")
        else:
            north, east, height, speed = (int(each) for each in step[1:])
            place = f"{HOME[0] + north / 1e6:.7f} N, {HOME[1] + east / 1e6:.7f} E"
            lines.append(f"goto({place}, altitude = {height} mm, speed = {speed} mm/s)")
    return f"{header}  phase departure {{ takeoff(altitude = 20 m) {' '.join(lines)} {last}() }}\n}}\n"


@cache
def policy_and_header() -> tuple[str, str]:
    """A policy that permits missions around the home of the plans, and the beginning of a mission under it."""
    made = import_file(ImportRequest(write(Path(), plan(TAKEOFF, RETURN, polygons=[fence()]))))
    assert isinstance(made, ImportedSource)
    policy, _, mission = made.text.partition("\nmission ")
    return policy, f"mission {mission.partition('  phase')[0]}"


@pytest.mark.slow
@settings(max_examples=30, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(STEPS, st.sampled_from(["return_home", "emergency_land"]))
def test_any_mission_comes_back_with_the_same_legs(steps: list[tuple[int | str, ...]], last: str) -> None:
    policy, header = policy_and_header()
    Path("policy.rts").write_text(policy, encoding="utf-8")
    text = 'import "policy.rts"\n' + source_of(steps, last, header)
    compiled = compile_reading(read_text("mine.rts", text), mission=None, issued_at_us=ISSUED)
    assert compiled.planned is not None, compiled.diagnostics
    before = compiled.planned.mission
    again = round_trip(compiled.planned.under.policy, before, Path("policy.rts"))
    assert same(legs(again), legs(before)), (legs(again), legs(before))
