"""Small policies and missions for the model: all times are one unit long, so that all orders can be tried.

`UNIT` is one step of the clock. Limits are whole units, so that times equal to a limit are tried as well.
"""

from dataclasses import dataclass
from typing import Any

from msgspec.structs import replace

from reference import flat_case as flat
from reference.flat_case import BATTERY, FIX, GOTO, HOME, HOVER, LAND, NOMINAL, TAKEOFF, WIND, M, S
from rtshcua.model.flat.contract import Contract, Link, MotionKind
from rtshcua.model.flat.limits import MAX_SPEED
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible, Plan
from rtshcua.model.flat.policy import AfterSilence, Policy, RuleKind
from rtshcua.onboard.runtime.limits import Limits

UNIT = S
GRACE = UNIT // 2  # shorter than the longest duration of a skill, or it would never expire first
LIMITS = Limits(
    ready_us=UNIT, silent_us=UNIT // 2, fresh_us=UNIT, flapping_us=UNIT, retry_us=UNIT, tries=1, again_us=UNIT // 2
)

GOOD = dict(NOMINAL)
#: the vehicle's reports: nominal; too windy for a step, not for links; no position; nothing known; no charge
PROFILES: dict[str, dict[int, int | None]] = {
    "good": GOOD,
    "windy": GOOD | {WIND: 12 * M},
    "no-fix": GOOD | {FIX: 0},
    "blind": GOOD | {WIND: None, FIX: None},
    "low": GOOD | {BATTERY: 2_000},
}

CONFIRM = flat.rule(RuleKind.CONFIRM, GOTO, approver=flat.SUPERVISOR, within_us=UNIT)


@dataclass(frozen=True)
class Small:
    """The parameters of one search: policy, mission, reports and documents."""

    name: str
    policy: Policy
    mission: Mission
    profiles: tuple[str, ...]
    events: tuple[str, ...]
    documents: tuple[str, ...] = ()


#: events by their cause
VEHICLE = ("ready", "on the ground", "in the air", "succeeded", "failed", "time")
LINK = ("link lost", "link back")
PEOPLE = ("taken over", "interrupted", "left alone")
WORST = ("crashed", "restarted")
RECORDS = ("armed", "late success", "evidence failed")
REST = (*RECORDS, "silence")


def policy(
    contingency: tuple[Link, ...],
    chain: tuple[Link, ...],
    *,
    confirm: bool = False,
    degrade: bool = False,
    after: AfterSilence = AfterSilence.CONTINGENCY,
) -> Policy:
    """A policy that permits everything; each step has `chain` as its fallback, except a take-off, which lands."""

    def contract(of: Contract) -> Contract:
        duration_us = UNIT
        fallback = of.fallback and ((flat.link(LAND),) if of is flat.CONTRACTS[TAKEOFF] else chain)
        require = tuple(each for each in of.require if each is flat.FIX_IS_GOOD)
        assume = tuple(each for each in of.assume if each is flat.CALM)
        return replace(
            of, deadline_us=UNIT, duration_us=duration_us, grace_us=GRACE, fallback=fallback, phases=(),
            require=require, assume=assume, maintain=(), reads=(WIND,) * len(assume) + (FIX,) * len(require),
        )  # fmt: skip

    rules = [flat.rule(RuleKind.PERMIT, *range(len(flat.CONTRACTS)))]
    rules += [CONFIRM] if confirm else []
    rules += [replace(flat.RULES[-1], target=flat.link(HOME))] if degrade else []
    stale_us = UNIT + UNIT // 2
    return replace(
        flat.POLICY,
        contracts=tuple(map(contract, flat.CONTRACTS)),
        signals=tuple(replace(each, stale_us=stale_us) for each in flat.POLICY.signals),
        contingency=contingency, rules=tuple(rules), airspace=None,
        vehicle=replace(flat.POLICY.vehicle, reserve=0, speed=MAX_SPEED, endurance_us=UNIT), silence_us=UNIT // 2,
        after_silence=after,
    )  # fmt: skip


def mission(of: Policy, skills: tuple[int, ...], otherwise: OnInadmissible = OnInadmissible.ABORT) -> Mission:
    """A mission of these skills in order."""
    plans = {
        TAKEOFF: (Plan(MotionKind.CLIMB, (), 20 * M, 0), (20 * M,)),
        GOTO: (Plan(MotionKind.FLY, (110 * M, -20 * M), 20 * M, 0), (110 * M, -20 * M, 20 * M)),
        HOME: (Plan(MotionKind.HOME, (0, 0), 0, 0), ()),
    }

    def step(number: int, skill: int) -> Invocation:
        plan, arguments = plans[skill]
        made = flat.invocation(number, flat.INSPECTION, skill, plan, *arguments)
        return replace(made, contract=of.contracts[skill], on_inadmissible=otherwise)

    return replace(flat.MISSION, invocations=tuple(step(*each) for each in enumerate(skills)))


HOLD, BACK, DOWN = flat.link(HOVER, limit_us=UNIT), flat.link(HOME), flat.link(LAND)


def small(
    name: str, skills: tuple[int, ...], profiles: tuple[str, ...], events: tuple[str, ...], *,
    contingency: tuple[Link, ...] = (HOLD, BACK, DOWN), chain: tuple[Link, ...] = (HOLD, BACK),
    otherwise: OnInadmissible = OnInadmissible.ABORT, confirm: bool = False, degrade: bool = False,
    documents: tuple[str, ...] = (), after: AfterSilence = AfterSilence.CONTINGENCY,
) -> Small:  # fmt: skip
    made = policy(contingency, chain, confirm=confirm, degrade=degrade, after=after)
    return Small(name, made, mission(made, skills, otherwise), profiles, events, documents)


#: in `make test`
TINY = small("tiny", (TAKEOFF, GOTO, HOME), ("good", "windy", "no-fix"), (*VEHICLE, *PEOPLE, *WORST))

_STEPS = (TAKEOFF, GOTO, HOME)


def _little(name: str, skills: tuple[int, ...], profiles: tuple[str, ...], *events: str, **more: Any) -> Small:
    return small(name, skills, profiles, (*VEHICLE, *events), **{"contingency": (BACK, DOWN), "chain": (HOLD,)} | more)


_HOLDS: Any = {"contingency": (HOLD, BACK, DOWN), "otherwise": OnInadmissible.HOLD}
#: in `make soak`
ALL = (
    small("chain", _STEPS, ("good", "windy", "no-fix"), (*VEHICLE, *PEOPLE, *WORST, *REST)),
    _little("everything", (TAKEOFF, HOME), ("good",), *PEOPLE, *WORST, *LINK, *RECORDS),
    _little("link", (TAKEOFF, HOME), ("good", "windy"), *LINK, *WORST, "taken over", "interrupted", "silence"),
    _little("stop", (TAKEOFF, GOTO), ("good", "no-fix"), *LINK, *WORST, "taken over", "silence", **_HOLDS),
    _little("goes on", (TAKEOFF, HOME), ("good", "blind"), *LINK, "silence", after=AfterSilence.CONTINUE),
    _little("unknown", _STEPS, ("good", "blind"), *WORST, "silence"),
    _little("late", _STEPS, ("good", "no-fix"), "armed", "late", "taken over", "interrupted"),
    _little("hold", _STEPS, ("good", "no-fix"), *WORST, "taken over", "interrupted", **_HOLDS),
    _little("skip", _STEPS, ("good", "no-fix"), *WORST, "interrupted", otherwise=OnInadmissible.SKIP),
    _little("degrade", _STEPS, ("good", "low"), *WORST, "interrupted", degrade=True),
    _little("recall", (TAKEOFF, HOME), ("good", "windy"), *LINK, documents=("recall",)),
    _little("approval", (TAKEOFF, GOTO), ("good",), *WORST, confirm=True, documents=("granted", "refused")),
    _little("waiting", (TAKEOFF, GOTO), ("good",), *LINK, confirm=True, documents=("granted",), **_HOLDS),
    _little("replacement", _STEPS, ("good",), *WORST, documents=("replaced", "recall")),
)
