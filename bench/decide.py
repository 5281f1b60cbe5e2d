"""`decide` and its authority step, compared with `cedarpy` with a parsed policy set, in turns in one run.

Cedar evaluates the equivalent rules with the same conditions over the same numbers, but without freshness, deadlines
and geometry. Exits with 1 when a limit of the project is missed.
"""

import random
import sys
from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path
from statistics import median
from time import perf_counter_ns

import cedarpy
from msgspec.structs import replace

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from reference import flat_case as flat
from reference import payload_case
from rtshcua.decision.decide import PASSED, authority, decide
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_invocation
from rtshcua.decision.situation import environment, situation
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import Contract, EmissionMoment, MotionKind
from rtshcua.model.flat.limits import MAX_EMISSIONS
from rtshcua.model.flat.mission import Invocation, Plan
from rtshcua.model.flat.policy import Policy, Rule, RuleKind
from rtshcua.model.flat.zone import POLYGON, Zone
from rtshcua.model.outcome import Outcome

DECIDE_MEDIAN, DECIDE_P99, AUTHORITY_MEDIAN, MANY_RULES = 30.0, 100.0, 5.0, 2.0  # us, us, us, ratio
PAYLOAD = 1.03  # a decision on a skill that emits commands to payload, against one on the same skill without
ROUNDS, CALLS = 40, 250
KEYS, WIDE = 1_000, 1_000  # skills and roles with rules in large policies; candidates in a wide policy
ENTITIES = cedarpy.Entities.from_json_str("[]")
ALTITUDE, BATTERY = 20 * flat.M, 9_000


def measured(*questions: Callable[[], object]) -> list[tuple[float, float]]:
    """Return median and 99th percentile of each call in us, measured in turns so that noise affects all alike."""
    times: list[list[int]] = [[] for _ in questions]
    for _ in range(ROUNDS):
        for question, taken in zip(questions, times, strict=True):
            until = perf_counter_ns() + 50_000_000
            for _ in range(CALLS):
                start = perf_counter_ns()
                question()
                end = perf_counter_ns()
                taken.append(end - start)
                if end > until:
                    break
    return [(median(taken) / 1e3, sorted(taken)[len(taken) * 99 // 100] / 1e3) for taken in times]


# ------------------------------------------------------------------------------------------------- authority

Key = tuple[int, int]


class Scenario:
    """Equivalent policies for `decide` and Cedar: each of `keys` has `candidates` permits, of which the last matches.

    `shared` of the candidates apply to any skill and role.
    """

    def __init__(self, name: str, keys: int, candidates: int, shared: int = 0) -> None:
        self.name, self.keys, self.candidates, self.shared = name, keys, candidates, shared
        self.skills, self.roles = -(-keys // 10), min(keys, 10)

    def rules(self) -> Iterator[tuple[Key | None, int, int]]:
        """Yield key (None: any), highest altitude (0: any) and least charge of each rule."""
        for number in range(self.shared):
            yield None, 0, 9_500 + number
        for at in range(self.keys):
            key = divmod(at, self.roles)
            for number in range(self.candidates - self.shared - 1):
                yield key, 1_000 + number, 2_500
            yield key, 40 * flat.M, 2_500

    def ours(self) -> Policy:
        takeoff = flat.CONTRACTS[flat.TAKEOFF]
        return replace(
            flat.POLICY,
            contracts=tuple(replace(takeoff, name=f"s{n}", fallback=()) for n in range(self.skills)),
            roles=tuple(f"r{n}" for n in range(self.roles)),
            rules=tuple(_rule(*rule) for rule in self.rules()),
            contingency=(),
        )

    def cedar(self) -> cedarpy.PolicySet:
        return cedarpy.PolicySet.from_str("\n".join(_cedar(*rule) for rule in self.rules()))


def _rule(key: Key | None, altitude: int, battery: int) -> Rule:
    code = flat.apply(Op.GE, flat.signal(flat.BATTERY), flat.const(battery))
    if key is None:
        return flat.rule(RuleKind.PERMIT, when=flat.clause("", code))
    below = flat.apply(Op.LE, flat.argument(0), flat.const(altitude))
    when = flat.clause("", flat.apply(Op.AND, below, code))
    return flat.rule(RuleKind.PERMIT, key[0], roles=(key[1],), when=when)


def _cedar(key: Key | None, altitude: int, battery: int) -> str:
    if key is None:
        return f"permit(principal, action, resource) when {{ context.battery >= {battery} }};"
    return (
        f'permit(principal == Role::"r{key[1]}", action == Action::"s{key[0]}", resource) '
        f"when {{ context.altitude <= {altitude} && context.battery >= {battery} }};"
    )


def asked_of_cedar(policies: cedarpy.PolicySet, keys: list[Key], **extra: object) -> Callable[[], object]:
    """Call Cedar for each key in turn; every answer must be "allow"."""
    requests = [
        {
            "principal": f'Role::"r{role}"',
            "action": f'Action::"s{skill}"',
            "resource": 'Vehicle::"quad-07"',
            "context": {"altitude": ALTITUDE, "battery": BATTERY, **extra},
        }
        for skill, role in keys
    ]
    for request in requests:
        assert cedarpy.is_authorized(request, policies, ENTITIES).allowed
    turn = cycle(requests)
    return lambda: cedarpy.is_authorized(next(turn), policies, ENTITIES)


def asked_of_authority(policy: PreparedPolicy, keys: list[Key]) -> Callable[[], object]:
    """Call the authority step for each key in turn."""
    plan = Plan(MotionKind.CLIMB, (), ALTITUDE, 0)
    sets = situation(flat.state(), policy, flat.NOW)
    cases = []
    for skill, role in keys:
        contract = policy.policy.contracts[skill]
        invocation = flat.invocation(0, 0, 0, plan, ALTITUDE)
        invocation = replace(invocation, skill=skill, role=role, contract=contract)
        one = prepared(invocation, policy)
        cases.append((one, environment(sets, policy, one.arguments, one.phase)))
    assert all(authority(*case) is PASSED for case in cases)
    turn = cycle(cases)
    return lambda: authority(*next(turn))


def prepared(invocation: Invocation, policy: PreparedPolicy) -> PreparedInvocation:
    """Prepare a well-formed invocation."""
    found = prepare_invocation(invocation, policy, flat.MISSION.phases)
    assert not isinstance(found, Refusal), found
    return found


def loaded(policy: Policy) -> PreparedPolicy:
    """Prepare a well-formed policy."""
    found = prepare(policy)
    assert not isinstance(found, Refusal), found
    return found


# ---------------------------------------------------------------------------------------------------- decide


def ring(west: int, south: int, east: int, north: int) -> tuple[int, ...]:
    """Return a rectangle with 16 vertices."""
    xs, ys = [west + (east - west) * n // 4 for n in range(5)], [south + (north - south) * n // 4 for n in range(5)]
    corners = [(x, south) for x in xs[:4]] + [(east, y) for y in ys[:4]]
    corners += [(x, north) for x in xs[:0:-1]] + [(west, y) for y in ys[:0:-1]]
    return tuple(coordinate for corner in corners for coordinate in corner)


def sixteen(zone: Zone) -> Zone:
    """Return the zone with 16 vertices if it is a polygon."""
    return replace(zone, data=ring(*zone.data[:2], *zone.data[4:6])) if zone.shape == POLYGON else zone


def emitting(contracts: tuple[Contract, ...]) -> tuple[Contract, ...]:
    """Return contracts whose inspection emits as many commands to payload as a contract may have."""
    emits = (payload_case.emission(2_000, moment=EmissionMoment.TIME, amount=flat.S),) * MAX_EMISSIONS
    return tuple(replace(each, emits=emits) if each.name == "inspect_area" else each for each in contracts)


def inspection(policy: Policy) -> Invocation:
    """Return the step that inspects, with the policy's contract."""
    return replace(flat.INVOCATIONS[flat.INSPECTION_STEP], contract=policy.contracts[flat.INSPECT])


def ten_candidates(*, emits: bool = False) -> PreparedPolicy:
    """Return a policy of ten rules about the inspection, in zones of 16 corners."""
    low = [flat.apply(Op.LT, flat.signal(flat.BATTERY), flat.const(n)) for n in (1_000, 1_500, 2_000)]
    narrow = [flat.apply(Op.LE, flat.argument(1), flat.const(n * flat.M)) for n in (6, 8, 10)]
    rules = (
        *(flat.rule(RuleKind.FORBID, flat.INSPECT, when=flat.clause("", code)) for code in low),
        *(flat.rule(RuleKind.PERMIT, flat.INSPECT, roles=(0,), when=flat.clause("", code)) for code in narrow),
        flat.RULES[0],
        flat.RULES[flat.CONFIRM_RULE],
        flat.RULES[6],
        flat.rule(RuleKind.FORBID, flat.INSPECT, when=flat.clause("", low[0])),
    )
    contracts = emitting(flat.CONTRACTS) if emits else flat.CONTRACTS
    return loaded(replace(flat.POLICY, rules=rules, zones=tuple(map(sixteen, flat.ZONES)), contracts=contracts))


def asked_of_decide(places: int, *, emits: bool = False) -> Callable[[], object]:
    """Decide the inspection under ten rules about it, from one place or from several in turn."""
    policy = ten_candidates(emits=emits)
    invocation = prepared(inspection(policy.policy), policy)
    assert sum(map(len, invocation.candidates)) == 10
    states = [flat.state({flat.POSITION_X: 110 * flat.M + n}) for n in range(places)]
    context = flat.context()
    assert all(decide(invocation, at, policy, context, flat.NOW).outcome is Outcome.ALLOW for at in states)
    turn = cycle(states)
    return lambda: decide(invocation, next(turn), policy, context, flat.NOW)


def cedar_for_decide() -> Callable[[], object]:
    """Return the same ten rules, with `require` and `assume` as additional conditions of the permit."""
    who, skill = 'principal == Role::"r0"', 'action == Action::"s3"'
    text = [f"forbid(principal, {skill}, resource) when {{ context.battery < {n} }};" for n in (1_000, 1_500, 2_000)]
    text += [f"permit({who}, {skill}, resource) when {{ context.altitude <= {n * flat.M} }};" for n in (6, 8, 10)]
    text += [
        f'permit({who}, {skill}, resource) when {{ context.area == "bridge_a" && context.altitude <= 30000 && '
        "context.daytime >= 28800 && context.daytime <= 64800 && context.fix >= 3 && context.battery > 3500 && "
        "context.quality >= 4000 && context.wind < 10000 && context.obstacle > 5000 };",
        f"forbid(principal, {skill}, resource) when {{ context.altitude < 10000 }};",
        "forbid(principal, action, resource) when { context.battery < 2500 };",
        f"forbid(principal, {skill}, resource) when {{ context.battery < 1000 }};",
    ]
    extra = {"area": "bridge_a", "daytime": 61_600, "fix": 3, "quality": 9_000, "wind": 4_000, "obstacle": 20_000}
    return asked_of_cedar(cedarpy.PolicySet.from_str("\n".join(text)), [(3, 0)], **extra)


# ------------------------------------------------------------------------------------------------------ report


def scenarios() -> tuple[Scenario, ...]:
    """Return the measured calls, named by their sizes."""
    return (
        Scenario("authority, 1 candidate", 1, 1),
        Scenario("authority, 10 candidates", 1, 10),
        Scenario("authority, 10 of 10,000 rules", KEYS, 10),
        Scenario("authority, 10 of 10,000, random keys", KEYS, 10),
        Scenario("authority, 5 for any and 5 of 5,000", KEYS, 10, shared=5),
        Scenario("authority, 1,000 candidates", 1, WIDE),
    )


def main() -> int:
    """Measure and print a table; return 1 if a limit is missed."""
    print(f"{'':38}{'median us':>10}{'p99 us':>10}{'cedarpy':>10}{'p99 us':>10}{'ratio':>8}")
    figures: dict[str, tuple[float, float]] = {}
    faster = True
    chance = random.Random(7)
    rows = [
        ("decide, admissible, 10 rules", asked_of_decide(1), cedar_for_decide()),
        ("decide, from a new place each time", asked_of_decide(100), cedar_for_decide()),
    ]
    for one in scenarios():
        keys = [divmod(chance.randrange(one.keys), one.roles) for _ in range(500)] if "random" in one.name else [(0, 0)]
        rows.append((one.name, asked_of_authority(loaded(one.ours()), keys), asked_of_cedar(one.cedar(), keys)))
    for name, ours, cedar in rows:
        (mid, high), (cedar_mid, cedar_high) = measured(ours, cedar)
        figures[name] = (mid, high)
        faster = faster and mid < cedar_mid
        print(f"{name:38}{mid:10.1f}{high:10.1f}{cedar_mid:10.1f}{cedar_high:10.1f}{mid / cedar_mid:8.3f}")
    for name, any_rules in (("load 10,000 rules", 0), ("load 10,000 rules, 5,000 for any", 5_000)):
        policy = Scenario("", KEYS, 10).ours()
        rules = tuple(
            replace(rule, skills=(), roles=(), when=None) if number < any_rules else rule
            for number, rule in enumerate(policy.rules)
        )
        start = perf_counter_ns()
        asked_of_authority(loaded(replace(policy, rules=rules)), [(0, 0), divmod(KEYS - 1, 10)])
        print(f"{name:38}{(perf_counter_ns() - start) / 1e6:10.0f} ms")
    decided, ten = figures["decide, admissible, 10 rules"], figures["authority, 10 candidates"][0]
    many = figures["authority, 10 of 10,000 rules"][0] / ten
    print(f"10 candidates in 10,000 rules against 10 in 10: {many:.2f} times, limit {MANY_RULES}")
    (plain, _), (emitted, _) = measured(asked_of_decide(1), asked_of_decide(1, emits=True))
    ratio = emitted / plain
    held = {
        f"with {MAX_EMISSIONS} commands to payload: {ratio:.3f} times, limit {PAYLOAD}": ratio <= PAYLOAD,
        f"decide: median {decided[0]:.1f} us, limit {DECIDE_MEDIAN}": decided[0] <= DECIDE_MEDIAN,
        f"decide: p99 {decided[1]:.1f} us, limit {DECIDE_P99}": decided[1] <= DECIDE_P99,
        f"authority, 10 candidates: median {ten:.1f} us, limit {AUTHORITY_MEDIAN}": ten <= AUTHORITY_MEDIAN,
        f"10,000 rules: {many:.2f} times, limit {MANY_RULES}": many <= MANY_RULES,
        "faster than cedarpy in every row": faster,
    }
    for text, holds in held.items():
        print(f"{'held  ' if holds else 'MISSED'}  {text}")
    return int(not all(held.values()))


if __name__ == "__main__":
    sys.exit(main())
