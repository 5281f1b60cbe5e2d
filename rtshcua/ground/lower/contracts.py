"""Lower checked skill contracts and the links of chains to the flat form."""

from collections.abc import Iterable, Mapping, Sequence

from rtshcua.decision.tree import slots_read
from rtshcua.ground.checker.checks.emits import (
    ADDRESSEES,
    SUCCESSES,
    WAITS_US,
    limit_of,
    moment_of,
    sent_numbers,
)
from rtshcua.ground.checker.context import Bound, CheckContext
from rtshcua.ground.checker.name_scope import Argument
from rtshcua.ground.checker.types import Kind
from rtshcua.ground.lower.conditions import ConditionLowering, ConditionPlace
from rtshcua.ground.lower.policy_checks import applies
from rtshcua.ground.lower.tables import shortened
from rtshcua.model.durability import WORDS
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import (
    CHOICE,
    PLACE,
    QUANTITY,
    ZONE,
    Contract,
    Emission,
    EmissionParameter,
    EmissionSuccess,
    Facing,
    Link,
    Motion,
    MotionKind,
    Parameter,
    TimingClass,
)
from rtshcua.model.flat.policy import LeftOut, VehicleLimits
from rtshcua.model.flat.zone import MAX_COORDINATE
from rtshcua.model.ir.expression import Coordinates, Quantity
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.skills import ClauseDecl as ClauseDecl
from rtshcua.model.ir.skills import EmitsDecl, LinkDecl, MotionDecl, SkillDecl
from rtshcua.model.quantity import Dimension

#: default of `grace`: how long a clause may be unknown, us
DEFAULT_GRACE_US = 500_000
#: default of `record`
DEFAULT_RECORD = ("intent", "decision", "state", "authorization", "effect")


def recorded(names: Iterable[str]) -> tuple[str, ...]:
    """Return the meaning of a `record` clause: the kinds of evidence (by default all), and the durability, if given."""
    named = tuple(dict.fromkeys(names))
    kinds = tuple(name for name in named if name not in WORDS) or DEFAULT_RECORD
    durabilities = [word for word in WORDS if word in named]
    return (*kinds, *durabilities[-1:])


def cells_of(skill: SkillDecl) -> dict[str, int]:
    """Return the first argument cell of each parameter. A place has two cells."""
    cells: dict[str, int] = {}
    cell = 0
    for parameter in skill.parameters:
        cells[parameter.name.text] = cell
        cell += 2 if parameter.type.text == "position" else 1
    return cells


def _motion(motion: MotionDecl, cells: Mapping[str, int]) -> Motion:
    """Lower a motion; a parameter that it does not name has cell -1."""
    named = (motion.altitude, motion.speed, motion.time, motion.lowest)
    altitude, speed, time, lowest = (-1 if name is None else cells[name.text] for name in named)
    facing = Facing.ALONG if motion.facing is None else Facing.INWARD
    return Motion(int(MotionKind[motion.kind.upper()]), altitude, speed, time, lowest, int(facing))


class ContractLowering:
    """Lowers the skills of one policy. `numbers` are their indexes, `left_out` the clauses that do not apply."""

    def __init__(
        self, context: CheckContext, numbers: Mapping[str, int], conditions: ConditionLowering, vehicle: VehicleLimits
    ) -> None:
        self._context = context
        self.numbers = numbers
        self.conditions = conditions
        self.vehicle = vehicle
        self.left_out: list[LeftOut] = []

    def contract(self, skill: SkillDecl) -> Contract:
        """Lower a skill's contract, with its defaults."""
        assert skill.motion is not None
        assert skill.timing_class is not None
        assert skill.deadline is not None
        assert skill.validity is not None
        assert skill.energy is not None
        cells = cells_of(skill)
        place = ConditionPlace(self._context.scope_of(skill), cells, strict=True)
        require, assume, maintain = (
            self._clauses(part, clauses, place, skill)
            for part, clauses in (("require", skill.require), ("assume", skill.assume), ("maintain", skill.maintain))
        )
        return Contract(
            name=skill.name.text,
            parameters=tuple(
                self._parameter(argument, cells[name]) for name, argument in self._context.arguments(skill).items()
            ),
            motion=_motion(skill.motion, cells),
            timing_class=int(TimingClass[skill.timing_class.text.upper()]),
            deadline_us=skill.deadline.value,
            validity_us=skill.validity.value,
            phases=tuple(name.text for name in skill.phases),
            duration_us=0 if skill.duration is None else skill.duration.value,
            grace_us=DEFAULT_GRACE_US if skill.grace is None else skill.grace.value,
            require=require,
            assume=assume,
            maintain=maintain,
            fallback=self.chain(skill.fallback),
            energy=skill.energy.value,
            record=recorded(name.text for name in skill.record),
            reads=slots_read((*require, *assume, *maintain), self.vehicle, tuple(self.conditions.monitors.all)),
            emits=self._emissions(skill, cells),
        )

    def _emissions(self, skill: SkillDecl, cells: Mapping[str, int]) -> tuple[Emission, ...]:
        return tuple(self._emission(skill, emits, cells) for emits in skill.emits)

    def _emission(self, skill: SkillDecl, emits: EmitsDecl, cells: Mapping[str, int]) -> Emission:
        """Lower a command to payload, with all its parameters."""
        moment, by = moment_of(emits), emits.success
        assert moment is not None
        success = EmissionSuccess.ACKNOWLEDGEMENT if by is None else SUCCESSES[by.by.text]
        return Emission(
            command=self._context.dialect.enums["MAV_CMD"][emits.command.text],
            addressee=int(ADDRESSEES[emits.addressee.text]),
            parameters=tuple(
                EmissionParameter(int(sent.origin), -1 if sent.name is None else cells[sent.name], sent.value)
                for sent in sent_numbers(self._context, skill, emits)
            ),
            moment=int(moment),
            amount=emits.every.value if isinstance(emits.every, Quantity) else 0,
            success=int(success),
            bound=limit_of(emits, Dimension.ANGLE, 0),
            within_us=limit_of(emits, Dimension.DURATION, WAITS_US),
            required=int(emits.required),
            text=shortened(self._context.report.text(emits.span)),
        )

    def chain(self, links: Sequence[LinkDecl]) -> tuple[Link, ...]:
        """Lower the links of a chain, in order."""
        return tuple(self.link(link) for link in links)

    def link(self, link: LinkDecl) -> Link:
        """Lower a link with all its arguments."""
        text, source, start, end = self.conditions.files.place(link.span)
        return Link(
            skill=self.numbers[link.skill.text],
            arguments=self.cells(self._context.bound(link)),
            limit_us=0 if link.limit is None else link.limit.value,
            text=text,
            source=source,
            start=start,
            end=end,
        )

    def cells(self, bound: Sequence[Bound]) -> tuple[int, ...]:
        """Return arguments as integers: a zone as its index, a place as its local x and y in mm."""
        cells: list[int] = []
        for argument in bound:
            if isinstance(argument, ZoneDecl):
                cells.append(self.conditions.zones.index[argument.name.text])
            elif isinstance(argument, Coordinates):
                cells += self.conditions.zones.place(argument) or (0, 0)
            else:
                cells.append(argument)
        return tuple(cells)

    def _clauses(
        self, part: str, clauses: Sequence[ClauseDecl], place: ConditionPlace, skill: SkillDecl
    ) -> tuple[Clause, ...]:
        """Lower the clauses that apply to the vehicle, and record the others in `left_out`."""
        without = frozenset(self.vehicle.without)
        for clause in clauses:
            if not applies(clause, without):
                of_skill = self.numbers[skill.name.text]
                self.left_out.append(LeftOut(of_skill, part, *self.conditions.files.place(clause.span)))
        return tuple(self.conditions.clause(clause.condition, place) for clause in clauses if applies(clause, without))

    def _parameter(self, argument: Argument, cell: int) -> Parameter:
        declared, type = argument.declaration, argument.type
        labels = tuple(choice.text for choice in declared.choices)
        if type.kind is Kind.NUMBER:
            assert type.dimension is not None
            assert argument.low is not None
            assert argument.high is not None
            kind, dimension, low, high = QUANTITY, type.dimension.value, argument.low, argument.high
        elif type.kind is Kind.ENUMERATION:
            kind, dimension, low, high = CHOICE, "choice", 0, len(labels) - 1
        elif type.kind is Kind.ZONE:
            kind, dimension, low, high = ZONE, "zone", 0, len(self.conditions.zones.regions) - 1
        else:
            kind, dimension, low, high = PLACE, "position", -MAX_COORDINATE, MAX_COORDINATE
        return Parameter(declared.name.text, kind, dimension, cell, low, high, labels)
