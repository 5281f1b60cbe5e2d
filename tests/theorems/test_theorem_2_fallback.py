"""Theorem 2: a step that is not admitted leads to a bounded fallback.

Statement. Let fallbacks be bounded (assumption 3: each chain that compiles ends in a link without requirements). Then,
whatever happens to the vehicle and its link after the start of the mission, every flown command is an admitted step, or
a link of a signed chain: the step's own, or the policy's contingency. Each chain only advances; no step follows a
return or a landing; the number of links is bounded; and the flight ends in bounded time.

Attacker: the environment. Sensors fail, wind and obstacles come and go, the charge runs out, skills fail or never end,
the link breaks, the disk fails, people interrupt. The runtime is honest, and the vehicle finally obeys.

Enforced by: `rtshcua/onboard/runtime/fallback_flight.py`, `rtshcua/onboard/runtime/controller.py`,
`rtshcua/onboard/runtime/supervisor.py`, `rtshcua/onboard/enforcement/executor.py`, `rtshcua/decision/fallbacks.py`.

Not covered: no rule helps a vehicle that ignores all commands. A runtime that was taken over can delay or suppress a
fallback. The vehicle of the drawn histories obeys at once; the flights of campaigns are those of simulated autopilots,
and an independent judge looks at the true state (`docs/flying/campaigns.md`), but no physical one was flown. Every
reachable state of small missions is searched, not drawn (`docs/model-checking.md`).
"""

from collections.abc import Callable
from random import Random

import pytest
from hypothesis import given, settings

from reference import worlds
from reference.flat_case import BATTERY, FIX, LINK, OBSTACLE, WIND, M
from reference.world import FakeVehicle, Run, loaded, renewed
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement import executor as executors
from rtshcua.onboard.enforcement.executor import Commands, Executor
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import EvidenceFailed, Interrupted, LinkBack, LinkLost, TakenOver
from rtshcua.onboard.runtime.fallback_flight import Fallback
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.wire.permit import AGAIN

TEMPLATE = loaded()
SKILLS = ("takeoff", "goto", "inspect_area", "hover", "return_home")
HOMEWARD = (MotionKind.HOME, MotionKind.LAND)


def fails(run: Run, of: Random) -> None:
    run.vehicle.fails.add(of.choice(SKILLS))


def deaf(run: Run, of: Random) -> None:
    run.vehicle.deaf.add(of.choice(SKILLS))


def silent(run: Run, of: Random) -> None:
    run.vehicle.silent.add(of.choice([BATTERY, WIND, LINK, FIX, OBSTACLE]))


def told(run: Run, of: Random) -> None:
    near = {BATTERY: (9_000, 3_000, 1_000), WIND: (4 * M, 20 * M), OBSTACLE: (20 * M, 1 * M, None), FIX: (3, 0, None)}
    slot = of.choice([*near])
    run.vehicle.values[slot] = of.choice(near[slot])


def well(run: Run, _: Random) -> None:
    run.vehicle.silent.clear()
    run.vehicle.fails.clear()
    run.vehicle.deaf.clear()
    run.vehicle.values |= {slot: FakeVehicle().values[slot] for slot in (BATTERY, WIND, OBSTACLE, FIX)}


TROUBLES: tuple[Callable[[Run, Random], object], ...] = (
    fails,
    deaf,
    silent,
    told,
    told,
    well,
    lambda run, _: run.tick(LinkLost(0)),
    lambda run, _: run.tick(LinkBack(0)),
    lambda run, of: run.tick(Interrupted(0)) if of.random() < 0.2 else None,
    lambda run, of: run.tick(EvidenceFailed(0, "disk full")) if of.random() < 0.2 else None,
    lambda run, of: run.tick(TakenOver(0, "POSCTL")) if of.random() < 0.1 else None,
)


def flown(of: Random, troubles: int = 8, template: Loaded = TEMPLATE) -> Run | None:
    """A flight with faults; None if it did not end."""
    run = Run(renewed(template), FakeVehicle())
    for _ in range(troubles):
        for _ in range(of.choice([0, 1, 5, 30, 80])):
            if run.ending is None:
                run.tick()
        if run.ending is None:
            of.choice(TROUBLES)(run, of)
    if run.ending is None:
        run.vehicle.fails.clear()
        run.vehicle.deaf.clear()
        run.tick(LinkBack(0))
    try:
        return run.until_over(400)
    except AssertionError:
        return None


def broken(run: Run | None) -> list[str]:
    """The violations of the theorem in a flight."""
    if run is None:
        return ["it did not end"]
    policy, steps = run.loaded.bundle.policy, run.loaded.bundle.mission.invocations
    allowed = {(r["kind"], r["step"], r["link"]) for r in run.records if r.get("outcome") == "allow"}
    sent = [record for record in run.records if record.get("event") == "dispatched"]
    wrong, homeward, final, last = [], False, False, {1: (-1, -2), 2: (-1, -2)}
    for record, command in zip(sent, run.vehicle.commands, strict=True):
        kind, step, link = ref = (record["kind"], record["step"], record["link"])
        if kind == 0:
            meant = {steps[step].contract.name}
            wrong += [] if ref in allowed else ["a step without an admission"]
            wrong += ["a step after a return or a landing"] if homeward else []
        else:
            chain = steps[step].contract.fallback if kind == 1 else policy.contingency
            links = [rule.target for rule in policy.rules if rule.target] if link < 0 else [chain[link]]
            meant = {policy.contracts[each.skill].name for each in links}
            place = (step, max(link, -1))
            if kind == 1 and place[0] == last[1][0] and place <= last[1]:
                wrong.append("a chain went backwards")
            if kind == 2 and final and place < last[2]:
                wrong.append("the contingency went backwards")
            last[kind] = place
            homeward = homeward or command.kind in HOMEWARD
            final = final or (kind == 2 and command.kind in HOMEWARD)
        wrong += [] if command.skill in meant else ["another skill than the one that was signed"]
    moving = sum(
        record["kind"] != 0 and command.kind in HOMEWARD
        for record, command in zip(sent, run.vehicle.commands, strict=True)
    )
    bound = sum(len(each.contract.fallback) for each in steps) + len(policy.contingency) + AGAIN + Limits().tries
    return [*wrong, *(["more links than there are"] if moving > bound else [])]


@pytest.mark.claim("T2")
@given(worlds.CHANCES)
def test_every_flight_in_trouble_falls_back_and_ends(of: Random) -> None:
    assert broken(flown(of)) == []


@pytest.mark.claim("T2")
@pytest.mark.soak
@settings(max_examples=5_000)
@given(worlds.CHANCES)
def test_every_flight_with_more_faults_falls_back_and_ends(of: Random) -> None:
    assert broken(flown(of, 20)) == []


def breaks(what: str, most: int = 120) -> bool:
    """Whether some flight violates the theorem in this way."""
    return any(what in broken(flown(Random(seed))) for seed in range(most))


def test_flights_cover_all_fallbacks() -> None:
    kinds: set[tuple[object, bool]] = set()
    for seed in range(60):
        run = flown(Random(seed))
        assert run is not None
        kinds |= {(record["kind"], record["link"] < 0) for record in run.records if record.get("event") == "dispatched"}
    assert kinds >= {(0, True), (1, False), (2, False)}


@pytest.mark.claim("T2", broken="an executor that sends another command than the signed link")
def test_search_detects_unsigned_command(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Commands._of_link
    monkeypatch.setattr(Commands, "_of_link", lambda self, link: ("goto", *made(self, link)[1:]))
    assert breaks("another skill than the one that was signed")


@pytest.mark.claim("T2", broken="chains that start again")
def test_search_detects_restarted_chain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the executor nor the runtime remembers the last link."""
    monkeypatch.setattr(Executor, "_refuse_link", lambda *_: None)
    choose = Fallback._choose

    def first(self: Fallback, state: object, now: object) -> object:
        self._chain.after = executors._UNTOUCHED
        return choose(self, state, now)

    monkeypatch.setattr(Fallback, "_choose", first)
    assert breaks("a chain went backwards") or breaks("it did not end")


@pytest.mark.claim("T2", broken="a runtime without fallbacks")
def test_search_detects_runtime_without_fallback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Fallback, "turn", lambda *_: True)
    assert breaks("it did not end", 20)
