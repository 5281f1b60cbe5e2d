"""Random well-typed conditions, as IR: sums, products, quotients, `abs`, `min`, `max`, ranges, enumerations, places,
times of day, phases, and nested temporal operators. Numbers are round, so that ties are common.
"""

from random import Random

from rtshcua.diagnostics.span import Span
from rtshcua.model.ir import expression as ir
from rtshcua.model.ir.node import Name
from rtshcua.model.quantity import Dimension

HERE = Span("x", 0, 0)
HOUR = 3_600_000_000

LENGTH, ALTITUDE, SPEED = Dimension.LENGTH, Dimension.ALTITUDE, Dimension.SPEED
DURATION, RATIO, COUNT = Dimension.DURATION, Dimension.RATIO, Dimension.COUNT

#: numbers by dimension: signals, then arguments
SIGNALS = {
    LENGTH: ["obstacle.distance", "gps.accuracy"],
    ALTITUDE: ["height"],
    SPEED: ["wind.speed"],
    RATIO: ["battery", "link.quality"],
    COUNT: ["satellites"],
    DURATION: [],
}
ARGUMENTS = {LENGTH: ["gap"], ALTITUDE: ["up"], SPEED: ["pace"], DURATION: ["wait"], RATIO: [], COUNT: []}
#: the unit of the literals of a dimension
STEP = {LENGTH: 500, ALTITUDE: 500, SPEED: 500, DURATION: 500_000, RATIO: 2500, COUNT: 1}
ENUMERATIONS = {
    "gps.fix": ["no_gps", "no_fix", "fix_2d", "fix_3d", "dgps", "rtk_float", "rtk_fixed", "static", "ppp"],
    "look": ["near", "far", "all"],
}
ZONES = ["city", "school"]
PHASES = ["departure", "inspection", "recovery"]
OPERATORS = ["<", "<=", ">", ">=", "==", "!="]


class Maker:
    """Draws conditions; `observed` ones are under a temporal operator, and read no argument and no phase."""

    def __init__(self, random: Random) -> None:
        self.random = random

    def literal(self, dimension: Dimension, *, zero: bool = True) -> ir.Quantity:
        value = self.random.randint(-4, 8)
        if dimension is ALTITUDE:
            dimension = LENGTH
        value = value if zero or value else 1
        return ir.Quantity(span=HERE, value=value * STEP[dimension], dimension=dimension)

    def constant(self, dimension: Dimension, *, zero: bool = True) -> ir.Value:
        """A number made of literals, exact and often not whole."""
        first = self.literal(dimension, zero=zero)
        match self.random.randrange(6):
            case 0:
                return self.arithmetic("/", first, self.literal(COUNT, zero=False))
            case 1:
                return self.arithmetic("*", self.literal(COUNT, zero=zero), first)
            case 2:
                return self.function(self.random.choice(["min", "max"]), first, first, first)
            case _:
                return first

    def number(self, dimension: Dimension, depth: int, observed: bool) -> ir.Value:
        """A number that reads a value, or at the lowest depth perhaps a constant."""
        kind = self.random.randrange(10) if depth else 0
        again = depth - 1
        match kind:
            case 0 | 1 | 2:
                return self.name(dimension, observed)
            case 3:
                operator = self.random.choice("+-")
                if dimension is ALTITUDE:
                    return self.arithmetic(
                        operator, self.number(ALTITUDE, again, observed), self.length(again, observed)
                    )
                return self.arithmetic(
                    operator, self.number(dimension, again, observed), self.number(dimension, again, observed)
                )
            case 4:
                kinds = [COUNT] if dimension is COUNT else [COUNT, RATIO]
                sides = [self.constant(self.random.choice(kinds)), self.number(dimension, again, observed)]
                return self.arithmetic("*", *self.random.sample(sides, 2))
            case 5:
                kinds = [COUNT] if dimension in (RATIO, COUNT) else [COUNT, RATIO]
                by = self.constant(self.random.choice(kinds), zero=False)
                return self.arithmetic("/", self.number(dimension, again, observed), by)
            case 6:
                return self.function("abs", self.number(dimension, again, observed))
            case 7:
                return self.function(
                    self.random.choice(["min", "max"]),
                    self.number(dimension, again, observed),
                    *(
                        self.constant(dimension)
                        if self.random.random() < 0.4
                        else self.number(dimension, again, observed)
                        for _ in range(self.random.randint(1, 2))
                    ),
                )
            case _:
                return self.converted(dimension, again, observed)

    def length(self, depth: int, observed: bool) -> ir.Value:
        return self.constant(LENGTH) if self.random.random() < 0.5 else self.number(LENGTH, depth, observed)

    def converted(self, dimension: Dimension, depth: int, observed: bool) -> ir.Value:
        """A number of one dimension from numbers of others."""
        random = self.random
        if dimension is LENGTH:
            if random.random() < 0.3:
                return self.arithmetic(
                    "-", self.number(ALTITUDE, depth, observed), self.number(ALTITUDE, depth, observed)
                )
            one, other = random.choice([(SPEED, DURATION), (DURATION, SPEED)])
            return self.arithmetic("*", *random.sample([self.number(one, depth, observed), self.constant(other)], 2))
        if dimension in (SPEED, DURATION):
            by = DURATION if dimension is SPEED else SPEED
            return self.arithmetic("/", self.number(LENGTH, depth, observed), self.constant(by, zero=False))
        if dimension is COUNT:
            of = random.choice([LENGTH, SPEED, RATIO])
            return self.arithmetic("/", self.number(of, depth, observed), self.constant(of, zero=False))
        return self.name(dimension, observed)

    def name(self, dimension: Dimension, observed: bool) -> ir.Value:
        known = SIGNALS[dimension] + ([] if observed else ARGUMENTS[dimension])
        return ir.Reference(span=HERE, name=self.random.choice(known)) if known else self.literal(dimension)

    def arithmetic(self, operator: str, left: ir.Value, right: ir.Value) -> ir.Value:
        return ir.Arithmetic(span=HERE, operator=operator, left=left, right=right)

    def function(self, name: str, *operands: ir.Value) -> ir.Value:
        return ir.Function(span=HERE, name=name, operands=operands)

    def atom(self, depth: int, observed: bool) -> ir.Condition:
        random = self.random
        dimension = random.choice([LENGTH, ALTITUDE, SPEED, DURATION, RATIO, COUNT])
        if observed and dimension is DURATION:
            dimension = LENGTH
        match random.randrange(10):
            case 0 | 1 | 2 | 3 | 4:
                left, right = self.number(dimension, depth, observed), self.bound(dimension, depth, observed)
                left, right = random.sample([left, right], 2)
                return ir.Comparison(span=HERE, operator=random.choice(OPERATORS), left=left, right=right)
            case 5:
                low, high = sorted((self.literal(dimension) for _ in range(2)), key=lambda each: each.value)
                limits = ir.Range(span=HERE, low=low, high=high)
                return ir.Within(span=HERE, subject=self.number(dimension, depth, observed), range=limits)
            case 6 | 7:
                return self.membership(observed)
            case 8:
                subject, region = (ir.Reference(span=HERE, name=name) for name in ("position", random.choice(ZONES)))
                return ir.Inside(span=HERE, subject=subject, region=region, negated=random.random() < 0.5)
            case _:
                if observed or random.random() < 0.5:
                    low, high = (ir.TimeOfDay(span=HERE, value=random.randrange(24) * HOUR) for _ in range(2))
                    clock = ir.Reference(span=HERE, name="local time")
                    return ir.Within(span=HERE, subject=clock, range=ir.Range(span=HERE, low=low, high=high))
                return self.phase()

    def bound(self, dimension: Dimension, depth: int, observed: bool) -> ir.Value:
        if self.random.random() < 0.5:
            return self.constant(dimension)
        return self.number(dimension, depth, observed)

    def membership(self, observed: bool) -> ir.Condition:
        random = self.random
        name = "gps.fix" if observed else random.choice(sorted(ENUMERATIONS))
        members = ENUMERATIONS[name]
        subject = ir.Reference(span=HERE, name=name)
        if random.random() < 0.4:
            chosen = random.sample(members, random.randint(1, len(members)))
            return ir.OneOf(span=HERE, subject=subject, names=tuple(Name(span=HERE, text=each) for each in chosen))
        if name == "gps.fix" and random.random() < 0.3:
            low, high = sorted(random.sample(range(len(members)), 2))
            ends = [ir.Reference(span=HERE, name=members[each]) for each in (low, high)]
            return ir.Within(span=HERE, subject=subject, range=ir.Range(span=HERE, low=ends[0], high=ends[1]))
        operator = random.choice(OPERATORS if name == "gps.fix" else ["==", "!="])
        sides = random.sample([subject, ir.Reference(span=HERE, name=random.choice(members))], 2)
        return ir.Comparison(span=HERE, operator=operator, left=sides[0], right=sides[1])

    def phase(self) -> ir.Condition:
        subject = ir.Reference(span=HERE, name="phase")
        if self.random.random() < 0.4:
            chosen = self.random.sample(PHASES, self.random.randint(1, 2))
            return ir.OneOf(span=HERE, subject=subject, names=tuple(Name(span=HERE, text=each) for each in chosen))
        other = ir.Reference(span=HERE, name=self.random.choice(PHASES))
        return ir.Comparison(span=HERE, operator=self.random.choice(["==", "!="]), left=subject, right=other)

    def condition(self, depth: int, observed: bool = False) -> ir.Condition:
        """A condition, at most `depth` connectives and temporal operators deep."""
        random = self.random
        if not depth:
            return self.atom(random.randint(0, 2), observed)
        match random.randrange(9):
            case 0 | 1:
                return self.atom(random.randint(1, 3), observed)
            case 2:
                return ir.Not(span=HERE, operand=self.condition(depth - 1, observed))
            case 3 | 4:
                operands = tuple(self.condition(depth - 1, observed) for _ in range(random.randint(2, 3)))
                return ir.Junction(span=HERE, operator=random.choice(["and", "or"]), operands=operands)
            case 5:
                return ir.ForLast(span=HERE, operand=self.condition(depth - 1, True), window=self.window())
            case 6:
                return ir.WithinLast(span=HERE, operand=self.condition(depth - 1, True), window=self.window())
            case 7:
                left, right = (self.condition(depth - 1, True) for _ in range(2))
                return ir.Near(span=HERE, left=left, right=right, window=self.window())
            case _:
                return ir.Edge(span=HERE, rising=random.random() < 0.5, operand=self.condition(depth - 1, True))

    def window(self) -> ir.Quantity:
        value = self.random.choice([1, 500_000, 900_000, 1_500_000, 3_000_000])
        return ir.Quantity(span=HERE, value=value, dimension=DURATION)
