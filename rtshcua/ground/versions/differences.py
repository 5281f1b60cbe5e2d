"""The differences between two policies, each in a few words, the most important first.

The comparison uses the meaning of flat policies. Names replace the indexes of the flat form, so that an inserted
declaration is one difference. Files, offsets, digests and quoted texts are ignored, and so are derived data: slots,
sets, tables, derived zones.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from msgspec.structs import replace

from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.contract import PLACE, ZONE, Contract, Link, Parameter
from rtshcua.model.flat.policy import Policy, Rule, RuleKind
from rtshcua.model.flat.signal import POSITION

Part = object
Fields = Mapping[str, Part]


class RuleMeaning(NamedTuple):
    """The meaning of a rule, and its text."""

    meaning: tuple[Part, ...]
    kind: int
    skills: frozenset[str]
    text: str


class PolicyMeaning:
    """The parts of a policy by name; `zones` are the declared zones that count as members of sets.

    `moved` omits local coordinates, because they are relative to home.
    """

    def __init__(self, policy: Policy, zones: frozenset[str], *, moved: bool) -> None:
        self._policy = policy
        self._common = zones
        self._moved = moved
        self._slots: dict[int, str] = {}
        for signal in policy.signals:
            self._slots[signal.slot] = signal.name
            if signal.kind == POSITION:
                self._slots[signal.slot + 1] = f"{signal.name}.y"

    def vehicle(self) -> Fields:
        """The fields of the vehicle, with its home."""
        vehicle, projection = self._policy.vehicle, self._policy.projection
        return {
            "name": vehicle.name,
            "identity": vehicle.identity,
            "home": (projection.latitude, projection.longitude, projection.east, projection.north, vehicle.home_within),
            "speed": vehicle.speed,
            "climb": vehicle.climb,
            "position error": vehicle.position_error,
            "energy": vehicle.endurance_us,
            "reserve": vehicle.reserve,
            "local time": vehicle.time_zone or vehicle.utc_offset_us,
            "brakes": (vehicle.braking, vehicle.reaction_us),
            "return": vehicle.return_altitude,
            "speeds": vehicle.speeds,
            "servos": vehicle.servos,
        }

    def zones(self) -> Mapping[str, Fields]:
        """The declared zones."""
        return {
            zone.name: {
                "shape": (zone.shape, () if self._moved else zone.data),
                "floor": zone.floor,
                "ceiling": zone.ceiling,
                "active": (zone.daily, zone.weekly, zone.dates),
            }
            for zone in self._policy.zones[: self._policy.declared]
        }

    def signals(self) -> Mapping[str, Fields]:
        """The signals that the policy reads."""
        return {
            signal.name: {
                "type": (signal.kind, signal.dimension, tuple(sorted(signal.labels))),
                "stale": signal.stale_us,
                "source": signal.sources,
            }
            for signal in self._policy.signals
        }

    def skills(self) -> Mapping[str, Fields]:
        """The contracts of the skills."""
        return {contract.name: self._contract(contract) for contract in self._policy.contracts}

    def rules(self) -> tuple[RuleMeaning, ...]:
        """The rules in their order."""
        return tuple(map(self._rule, self._policy.rules))

    def airspace(self) -> Part:
        """The zones to stay inside and outside of."""
        airspace = self._policy.airspace
        return None if airspace is None else (self._names(airspace.inside), self._names(airspace.outside))

    def contingency(self) -> Part:
        """The links that fly when a step is denied in the air."""
        return self._chain(self._policy.contingency)

    def without_evidence(self) -> Part:
        """The action of a flight while its records cannot be kept."""
        return self._policy.without_evidence

    def without_link(self) -> Part:
        """The limit of a silence of the vehicle, and the action after it."""
        return self._policy.silence_us, self._policy.after_silence

    def without(self) -> frozenset[str]:
        """The signals whose sensors the vehicle lacks."""
        return frozenset(self._policy.vehicle.without)

    def _contract(self, contract: Contract) -> Fields:
        own = contract.parameters
        return {
            "parameters": tuple(map(_parameter, own)),
            "motion": contract.motion,
            "class": contract.timing_class,
            "deadline": contract.deadline_us,
            "valid": (contract.validity_us, frozenset(contract.phases)),
            "lasts": contract.duration_us,
            "grace": contract.grace_us,
            "require": self._clauses(contract.require, own),
            "assume": self._clauses(contract.assume, own),
            "maintain": self._clauses(contract.maintain, own),
            "fallback": self._chain(contract.fallback),
            "energy": contract.energy,
            "record": frozenset(contract.record),
            "emits": tuple(replace(each, text="") for each in contract.emits),
        }

    def _rule(self, rule: Rule) -> RuleMeaning:
        policy = self._policy
        skills = frozenset(policy.contracts[number].name for number in rule.skills)
        parameters = policy.contracts[rule.skills[0]].parameters if rule.skills else ()
        meaning = (
            rule.kind,
            skills,
            frozenset(policy.roles[number] for number in rule.roles),
            frozenset(rule.sources),
            None if rule.when is None else self._code(rule.when, parameters),
            "" if rule.approver == -1 else policy.roles[rule.approver],
            "" if rule.second == -1 else policy.roles[rule.second],
            rule.within_us,
            None if rule.target is None else self._link(rule.target),
        )
        return RuleMeaning(meaning, rule.kind, skills, rule.text)

    def _chain(self, links: Iterable[Link]) -> Part:
        return tuple(map(self._link, links))

    def _link(self, link: Link) -> Part:
        contract = self._policy.contracts[link.skill]
        arguments = tuple(self._argument(parameter, link.arguments) for parameter in contract.parameters)
        return contract.name, arguments, link.limit_us

    def _argument(self, parameter: Parameter, cells: tuple[int, ...]) -> Part:
        value = cells[parameter.cell]
        if parameter.kind == ZONE:
            return self._zone(value)
        if parameter.kind == PLACE:
            return None if self._moved else (value, cells[parameter.cell + 1])
        return value

    def _clauses(self, clauses: Iterable[Clause], parameters: tuple[Parameter, ...]) -> Part:
        return tuple(self._code(clause, parameters) for clause in clauses)

    def _code(self, clause: Clause, parameters: tuple[Parameter, ...]) -> Part:
        code = clause.code
        zones = frozenset(parameter.cell for parameter in parameters if parameter.kind == ZONE)
        return tuple(
            (op, *self._operands(op, a, b, zones)) for op, a, b in zip(code[::3], code[1::3], code[2::3], strict=True)
        )

    def _operands(self, op: int, a: int, b: int, zones: frozenset[int]) -> tuple[Part, ...]:
        policy = self._policy
        match op:
            case Op.SIGNAL | Op.KNOWN:
                return (self._slots[a],)
            case Op.SIGNAL_IN:
                return self._slots[a], policy.sets[b]
            case Op.ARGUMENT_IN if a in zones:
                return a, self._names(policy.sets[b]) & self._common
            case Op.ARGUMENT_IN:
                return a, policy.sets[b]
            case Op.POSITION_IN:
                return (self._zone(a),)
            case Op.POSITION_IN_ARGUMENT:
                return a, frozenset(
                    (self._zone(n), self._zone(to))
                    for n, to in enumerate(policy.tables[b])
                    if self._zone(n) in self._common
                )
            case Op.ARGUMENT_POINT_IN:
                return a, self._zone(b)
            case Op.WEEK_IN:
                return (policy.sets[a],)
            case Op.PHASE_IN:
                return (frozenset(policy.phases[number] for number in policy.sets[b]),)
            case Op.MONITOR:
                monitor = policy.monitors[a]
                return monitor.kind, monitor.window_us, self._code(monitor.when, ())
            case _:
                return a, b

    def _zone(self, number: int) -> str:
        return self._policy.zones[number].name

    def _names(self, zones: Iterable[int]) -> frozenset[str]:
        return frozenset(map(self._zone, zones))


def _parameter(parameter: Parameter) -> Part:
    """A parameter. A zone parameter may be any zone, so its range is ignored."""
    ends = None if parameter.kind == ZONE else (parameter.low, parameter.high)
    return parameter.name, parameter.kind, parameter.dimension, parameter.cell, ends, parameter.labels


#: the most characters of a rule's text that are quoted
_QUOTED = 60


class Difference(NamedTuple):
    """One difference: its text, and its kind (`rule`, `order`, `airspace`, `contingency`, `evidence`, `silence`,
    `sensor`, `vehicle`, `zone`, `skill`, `signal`).

    A `rule` has its old and new text, empty if there is none. A part with fields has its name and the fields that
    differ: all fields if it is new or removed.
    """

    text: str
    kind: str
    name: str = ""
    fields: tuple[str, ...] = ()
    before: str = ""
    after: str = ""


def differences(old: Policy, new: Policy) -> tuple[str, ...]:
    """Return the texts of the differences between two policies."""
    return tuple(each.text for each in compared(old, new))


def compared(old: Policy, new: Policy) -> tuple[Difference, ...]:
    """Return the differences between two policies; empty if both mean the same. Versions and names are ignored."""
    zones = frozenset(zone.name for zone in old.zones[: old.declared])
    common = zones & {zone.name for zone in new.zones[: new.declared]}
    moved = old.projection != new.projection
    return tuple(_differences(PolicyMeaning(old, common, moved=moved), PolicyMeaning(new, common, moved=moved)))


def _differences(old: PolicyMeaning, new: PolicyMeaning) -> Iterator[Difference]:
    # a missing sensor comes first, because a finding lists only a few differences
    for name in sorted(new.without() - old.without()):
        text = f"looser: the vehicle is now without the signal `{name}`, and its clauses `where fitted` are left out"
        yield Difference(text, "sensor", name)
    for name in sorted(old.without() - new.without()):
        yield Difference(f"the vehicle is no longer without the signal `{name}`", "sensor", name)
    yield from _rules(old.rules(), new.rules())
    if old.airspace() != new.airspace():
        yield Difference("the airspace", "airspace")
    if old.contingency() != new.contingency():
        yield Difference("the contingency", "contingency")
    if old.without_evidence() != new.without_evidence():
        yield Difference("the action without evidence", "evidence")
    if old.without_link() != new.without_link():
        yield Difference("the action after a silence of the vehicle", "silence")
    vehicle = _fields(old.vehicle(), new.vehicle())
    if vehicle:
        yield Difference(f"the vehicle ({', '.join(vehicle)})", "vehicle", fields=vehicle)
    yield from _named("zone", old.zones(), new.zones())
    yield from _named("skill", old.skills(), new.skills())
    yield from _named("signal", old.signals(), new.signals())


def _named(kind: str, old: Mapping[str, Fields], new: Mapping[str, Fields]) -> Iterator[Difference]:
    for name, fields in new.items():
        if name not in old:
            yield Difference(f"the new {kind} `{name}`", kind, name, tuple(fields))
        elif fields != old[name]:
            differ = _fields(old[name], fields)
            yield Difference(f"the {kind} `{name}` ({', '.join(differ)})", kind, name, differ)
    for name, fields in old.items():
        if name not in new:
            yield Difference(f"the removed {kind} `{name}`", kind, name, tuple(fields))


def _fields(old: Fields, new: Fields) -> tuple[str, ...]:
    return tuple(name for name, value in new.items() if value != old[name])


def _rules(old: tuple[RuleMeaning, ...], new: tuple[RuleMeaning, ...]) -> Iterator[Difference]:
    removed, added = _without(old, new), _without(new, old)
    for rule in added:
        before = next((each for each in removed if _alike(each, rule)), None)
        if before is None:
            yield Difference(f"the new rule `{_quoted(rule)}`", "rule", after=rule.text)
        else:
            removed.remove(before)
            yield Difference(f"the rule `{_quoted(rule)}`", "rule", before=before.text, after=rule.text)
    for rule in removed:
        yield Difference(f"the removed rule `{_quoted(rule)}`", "rule", before=rule.text)
    if not added and not removed:
        for kind in (RuleKind.CONFIRM, RuleKind.DEGRADE):  # the first of these that holds decides
            if _order(old, kind) != _order(new, kind):
                yield Difference(f"the order of its `{kind.name.lower()}` rules", "order", kind.name.lower())


def _order(rules: tuple[RuleMeaning, ...], kind: RuleKind) -> list[tuple[Part, ...]]:
    return [rule.meaning for rule in rules if rule.kind == kind]


def _without(rules: tuple[RuleMeaning, ...], others: tuple[RuleMeaning, ...]) -> list[RuleMeaning]:
    """The rules with a meaning that no other rule has."""
    known = {rule.meaning for rule in others}
    return [rule for rule in rules if rule.meaning not in known]


def _alike(one: RuleMeaning, other: RuleMeaning) -> bool:
    return one.kind == other.kind and (one.skills == other.skills or not one.skills.isdisjoint(other.skills))


def _quoted(rule: RuleMeaning) -> str:
    text = " ".join(rule.text.split())
    return text if len(text) <= _QUOTED else f"{text[: _QUOTED - 3]}..."
