"""A naive, independent `decide` for single situations, by the text of design 4.1 and 4.4."""

from itertools import pairwise
from math import ceil, isqrt

from reference.flat_case import MISSION
from reference.naive_code import Leg, Truths, World, truths
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import PLACE, Contract, Link, MotionKind
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy, Rule, RuleKind
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.flat.zone import MAX_COORDINATE
from rtshcua.model.outcome import Outcome, Reason

Answer = tuple[Outcome, Reason, int]
SOURCE_CLASSES = {0: (0, 1), 1: (0, 1), 2: (1,), 3: (2,)}


class Oracle:
    """One situation."""

    def __init__(self, policy: Policy, state: State, now: Now) -> None:
        self.policy, self.now, self.phase = policy, now, -1
        said = [{1: "T", 2: "F", 4: "U"}.get(truth) for truth in state.monitors]
        heard = len(said) == len(policy.monitors) and None not in said
        self.monitors = "".join(said) if heard else "U" * len(policy.monitors)
        self.slots: list[int | None] = [None] * policy.slots
        for signal in policy.signals:
            width, most = (2, MAX_COORDINATE) if signal.kind == 2 else (1, 2**53 - 1)
            for slot in range(signal.slot, signal.slot + width):
                value = state.values[slot]
                if value is not None and 0 <= state.ages[slot] <= signal.stale_us and abs(value) <= most:
                    self.slots[slot] = value

    def slot(self, slot: int) -> int | None:
        return None if slot == -1 else self.slots[slot]

    def place(self) -> tuple[int, int] | None:
        """The place over ground, if known."""
        vehicle = self.policy.vehicle
        x, y = (None, None) if vehicle.position == -1 else self.slots[vehicle.position : vehicle.position + 2]
        return None if x is None or y is None else (x, y)

    def truth(self, clause: Clause | None, arguments: tuple[int, ...]) -> str:
        """One letter: a single situation has a single truth."""
        if clause is None:
            return "T"
        at, z = self.place(), self.slot(self.policy.vehicle.height)
        (letter,) = truths(clause.code, self.world(arguments, [(at, at, (0, 0, 0, 0), z, z)]))
        return letter

    def world(
        self,
        arguments: tuple[int, ...],
        legs: list[Leg],
        heights: tuple[int, int] | None = None,
        through: int = 0,
    ) -> World:
        now = self.now
        about = (self.policy, self.slots, arguments, now.utc_us, now.utc_error_us, legs, heights)
        return World(*about, self.monitors, self.phase, through)

    # ------------------------------------------------------------------------------------------ planned volume

    def volume(
        self, kind: int, path: tuple[int, ...], altitude: int | None, heights: tuple[int, ...] = ()
    ) -> list[Leg]:
        """The planned legs; unknown if the place is unknown, with unknown heights if the height is unknown."""
        place, z = self.place(), self.slot(self.policy.vehicle.height)
        error = self.policy.vehicle.position_error
        box = (-error, -error, error, error)
        low = high = z
        if z is not None and altitude is not None:
            low, high = min(z, altitude), max(z, altitude)
        if z is not None and kind == MotionKind.LAND:
            low, high = min(z, 0), z
        points = [place, *zip(path[::2], path[1::2], strict=True)]
        if kind == MotionKind.HOME:
            down = None if low is None else min(low, 0)
            return [(place, (0, 0), box, low, high), (place and (0, 0), (0, 0), box, down, high)]
        if heights:
            ends = [*zip([z, *heights], heights, strict=False)]
            spans = [(None, None) if z is None else (min(a, b), max(a, b)) for a, b in ends]
            legs = [(a, b, box, *span) for (a, b), span in zip(pairwise(points), spans, strict=True)]
            return [(place and a, b, box, *span) for a, b, box, *span in legs]
        if len(points) == 1:
            return [(place, place, box, low, high)]
        return [(place and a, b, box, low, high) for a, b in pairwise(points)]

    def everywhere(self, found: Truths) -> str:
        return "F" if "F" in found else "U" if "U" in found else "T"

    def in_airspace(self, legs: list[Leg], through: int) -> str:
        airspace = self.policy.airspace
        if airspace is None:
            return "T"
        letters = set()
        for zone in airspace.inside:
            letters |= truths((28, zone, 0), self.world((), legs, through=through))
        for zone in airspace.outside:
            letters |= truths((28, zone, 0, 42, 0, 0), self.world((), legs, through=through))
        return self.everywhere(frozenset(letters))

    # -------------------------------------------------------------------------------------------------- links

    def may_fly(self, link: Link) -> bool:
        contract = self.policy.contracts[link.skill]
        if any(self.truth(clause, link.arguments) != "T" for clause in contract.require):
            return False
        kind = contract.motion.kind
        if kind in (MotionKind.HOLD, MotionKind.LAND):
            return True
        altitude = None if contract.motion.altitude == -1 else link.arguments[contract.motion.altitude]
        path: tuple[int, ...] = ()
        if kind == MotionKind.FLY:
            cell = next(p.cell for p in contract.parameters if p.kind == PLACE)
            path = link.arguments[cell : cell + 2]
        if kind == MotionKind.HOME and self.in_airspace(self.volume(MotionKind.HOLD, (), None), 0) == "F":
            return True
        longest = link.limit_us or contract.duration_us or self.policy.vehicle.endurance_us
        return self.in_airspace(self.volume(kind, path, altitude), longest) == "T"

    def enter(self, invocation: Invocation) -> None:
        """Use the phase of an invocation of the hand-written mission from here on."""
        name = MISSION.phases[invocation.phase]
        self.phase = next((n for n, phase in enumerate(self.policy.phases) if phase == name), -1)

    def target(self, invocation: Invocation) -> tuple[int, Link] | None:
        self.enter(invocation)
        for rule in self.rules(invocation, RuleKind.DEGRADE):
            if self.truth(rule.when, invocation.arguments) == "T" and self.may_fly(rule.target):
                return -1, rule.target
        return self.first(invocation.contract.fallback, -2)

    def first(self, chain: tuple[Link, ...], after: int) -> tuple[int, Link] | None:
        return next(((k, link) for k, link in enumerate(chain) if k > after and self.may_fly(link)), None)

    # -------------------------------------------------------------------------------------------------- rules

    def rules(self, invocation: Invocation, kind: RuleKind) -> list[Rule]:
        return [
            rule
            for rule in self.policy.rules
            if rule.kind == kind
            and (not rule.skills or invocation.skill in rule.skills)
            and (not rule.roles or invocation.role in rule.roles)
            and (not rule.sources or invocation.source in rule.sources)
            and not (kind == RuleKind.DEGRADE and rule.target.skill == invocation.skill)
        ]

    def decide(self, invocation: Invocation, context: Context) -> Answer:
        self.enter(invocation)
        for step in (self.one, self.two, self.three, self.three_b, self.four, self.five, self.six, self.seven):
            answer = step(invocation, context)
            if answer is not None:
                return answer
        return Outcome.ALLOW, Reason.ADMITTED, 8

    def one(self, invocation: Invocation, context: Context) -> Answer | None:
        if context.binding != invocation.binding:
            return Outcome.DENY, Reason.BINDING_MISMATCH, 1
        if context.vehicle != self.policy.vehicle.identity:
            return Outcome.DENY, Reason.WRONG_VEHICLE, 1
        if context.policy_version != self.policy.version:
            return Outcome.DENY, Reason.POLICY_VERSION, 1
        for p in invocation.contract.parameters:
            low, high, cells = (p.low, p.high, 1) if p.kind != PLACE else (-MAX_COORDINATE, MAX_COORDINATE, 2)
            if any(not low <= a <= high for a in invocation.arguments[p.cell : p.cell + cells]):
                return Outcome.DENY, Reason.ARGUMENT_RANGE, 1
        return None

    def two(self, invocation: Invocation, context: Context) -> Answer | None:
        issued, now, error = invocation.issued_at_us, self.now.utc_us, self.now.utc_error_us
        end = issued + invocation.contract.validity_us
        if context.consumed:
            return Outcome.DENY, Reason.REPLAYED, 2
        if now + error < issued:
            return Outcome.DENY, Reason.ISSUED_IN_FUTURE, 2
        if now - error > end:
            return Outcome.DENY, Reason.EXPIRED, 2
        if now - error < issued or now + error > end:
            return Outcome.DEFER, Reason.CLOCK_UNCERTAIN, 2
        return None

    def three(self, invocation: Invocation, context: Context) -> Answer | None:
        if invocation.contract.timing_class not in SOURCE_CLASSES[invocation.source]:
            return Outcome.DENY, Reason.CLASS_NOT_PERMITTED, 3
        forbids = [self.truth(r.when, invocation.arguments) for r in self.rules(invocation, RuleKind.FORBID)]
        permits = [self.truth(r.when, invocation.arguments) for r in self.rules(invocation, RuleKind.PERMIT)]
        if "T" in forbids:
            return Outcome.DENY, Reason.FORBIDDEN, 3
        if "T" not in permits:
            return Outcome.DENY, Reason.OUT_OF_SCOPE if permits else Reason.NOT_PERMITTED, 3
        return (Outcome.DEFER, Reason.FORBID_UNKNOWN, 3) if "U" in forbids else None

    def three_b(self, invocation: Invocation, context: Context) -> Answer | None:
        waiting = False
        self.released = context.released_us
        for rule in self.rules(invocation, RuleKind.CONFIRM):
            if self.truth(rule.when, invocation.arguments) == "F":
                continue
            number = next(n for n, other in enumerate(self.policy.rules) if other is rule)
            asked = {rule.approver} if rule.second < 0 else {rule.approver, rule.second}
            answers = [a for a in context.approvals if a.rule == number and a.role in asked]
            end = context.released_us + rule.within_us
            if any(not a.granted for a in answers):
                return Outcome.DENY, Reason.APPROVAL_REFUSED, 3
            granted = [a.monotonic_us for a in answers if a.monotonic_us <= end]
            if rule.second >= 0:
                pairs = [
                    (one, other)
                    for one in answers
                    for other in answers
                    if (one.role, other.role) == (rule.approver, rule.second) and one.person != other.person
                ]
                granted = [t for t in (max(a.monotonic_us for a in pair) for pair in pairs) if t <= end]
            if granted:
                self.released = max(self.released, min(granted))
            elif self.now.monotonic_us > end:
                return Outcome.DENY, Reason.APPROVAL_TIMED_OUT, 3
            else:
                waiting = True
        return (Outcome.DEFER, Reason.AWAITING_APPROVAL, 3) if waiting else None

    def four(self, invocation: Invocation, context: Context) -> Answer | None:
        phases = {n for n in range(64) if invocation.phases >> n & 1}
        if context.phase in phases:
            return None
        if any(phase > context.phase for phase in phases):
            return Outcome.DEFER, Reason.PHASE_NOT_REACHED, 4
        return Outcome.DENY, Reason.PHASE_PASSED, 4

    def five(self, invocation: Invocation, context: Context) -> Answer | None:
        elapsed = max(0, self.now.monotonic_us - self.released)
        late = context.remaining_us > invocation.contract.deadline_us - elapsed
        return (Outcome.FALLBACK, Reason.NO_SLACK, 5) if late else None

    def six(self, invocation: Invocation, context: Context) -> Answer | None:
        contract = invocation.contract
        letters = [self.truth(clause, invocation.arguments) for clause in (*contract.require, *contract.assume)]
        if "F" in letters:
            return Outcome.FALLBACK, Reason.STATE_VIOLATED, 6
        return (Outcome.DEFER, Reason.STATE_UNKNOWN, 6) if "U" in letters else None

    def seven(self, invocation: Invocation, context: Context) -> Answer | None:
        letters = self.seven_letters(invocation)
        for letter, reason in letters:
            if letter == "F":
                return Outcome.FALLBACK, reason, 7
        unknown = any(letter == "U" for letter, _ in letters)
        return (Outcome.DEFER, Reason.SAFETY_UNKNOWN, 7) if unknown else None

    def seven_letters(self, invocation: Invocation) -> list[tuple[str, Reason]]:
        contract, plan, vehicle = invocation.contract, invocation.plan, self.policy.vehicle
        altitude = None if contract.motion.altitude == -1 else plan.altitude
        legs = self.volume(plan.kind, plan.path, altitude, plan.heights)
        longest = contract.duration_us or vehicle.endurance_us
        letters = [
            ("T" if plan.speed <= vehicle.speed else "F", Reason.ENVELOPE),
            (self.in_airspace(legs, longest), Reason.AIRSPACE),
        ]
        heights = None
        if self.slot(vehicle.height) is not None:
            heights = (min(leg[3] for leg in legs), max(leg[4] for leg in legs))
        world = self.world(invocation.arguments, legs, heights, longest)
        letters += [(self.everywhere(truths(clause.code, world)), Reason.INVARIANT) for clause in contract.maintain]
        letters.append((self.charged(contract, legs), Reason.ENERGY))
        for rule in self.rules(invocation, RuleKind.DEGRADE):
            swapped = {"T": "F", "F": "T", "U": "U"}[self.truth(rule.when, invocation.arguments)]
            letters.append((swapped, Reason.DEGRADED))
        return letters

    def charged(self, contract: Contract, legs: list[Leg]) -> str:
        battery, vehicle = self.slot(self.policy.vehicle.battery), self.policy.vehicle
        ends = contract.motion.kind in (MotionKind.HOME, MotionKind.LAND)
        if battery is None or (self.place() is None and not ends):
            return "U"
        needed = contract.energy
        if not ends:
            square = max(x * x + y * y for a, b, *_ in legs for x, y in (a, b))
            distance = isqrt(square) + (isqrt(square) ** 2 < square)
            charge = -(-distance * 1_000_000 * 10_000 // (vehicle.speed * vehicle.endurance_us))
            assert charge == ceil(charge)
            needed += vehicle.reserve + charge
        return "T" if battery >= needed else "F"
