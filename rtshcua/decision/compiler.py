"""From the flat form of a well-formed policy to functions and prepared parts."""

from rtshcua.decision.evaluate import Condition, Tables, always, build
from rtshcua.decision.link import Guards, PreparedLink
from rtshcua.decision.parameters import first_cell
from rtshcua.decision.places import WellKnown
from rtshcua.decision.scope import scope_of
from rtshcua.decision.tree import Node, parse
from rtshcua.decision.values import point
from rtshcua.decision.volume import Planner, flown_at
from rtshcua.decision.zones import PreparedZone
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import PLACE, Contract, Link, MotionKind
from rtshcua.model.flat.policy import Monitor, Policy, Rule


class Compiler:
    """Compiles what was checked: a clause is read again here, and cannot fail any more."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._scope = scope_of(policy)
        self._conditions: dict[int, Condition] = {}
        self._requires: dict[int, Guards] = {}
        self.tables = Tables(
            zones=tuple(
                PreparedZone(number, zone, policy.vehicle.utc_offset_us) for number, zone in enumerate(policy.zones)
            ),
            tables=policy.tables,
            sets=tuple(frozenset(members) for members in policy.sets),
            known=_well_known(policy),
            utc_offset_us=policy.vehicle.utc_offset_us,
        )

    def node(self, clause: Clause, *contracts: Contract) -> Node:
        """The tree of a clause that may name the arguments of some contracts."""
        node = parse(clause.code, self._scope.about(*contracts))
        assert not isinstance(node, str), node
        return node

    def monitored(self, monitor: Monitor, number: int) -> Condition:
        """The condition that the temporal monitor of this number looks at."""
        node = parse(monitor.when.code, self._scope.inside_monitor(number))
        assert not isinstance(node, str), node
        return build(node, self.tables)

    def guards(self, clauses: tuple[Clause, ...], contract: Contract) -> Guards:
        """The clauses of a contract."""
        return tuple((clause, build(self.node(clause, contract), self.tables)) for clause in clauses)

    def when(self, rule: Rule) -> Node | None:
        """The tree of a rule's condition, if it has one."""
        if rule.when is None:
            return None
        return self.node(rule.when, *(self._policy.contracts[skill] for skill in rule.skills))

    def condition(self, rule: Rule, number: int) -> Condition:
        """The condition of a rule, compiled when it is first asked for."""
        found = self._conditions.get(number)
        if found is None:
            node = self.when(rule)
            found = self._conditions[number] = always if node is None else build(node, self.tables)
        return found

    def link(self, link: Link) -> PreparedLink:
        """A link with its skill's `require`."""
        contract, policy = self._policy.contracts[link.skill], self._policy
        require = self._requires.get(link.skill)
        if require is None:
            require = self._requires[link.skill] = self.guards(contract.require, contract)
        motion = contract.motion
        path: tuple[int, ...] = ()
        if motion.kind == MotionKind.FLY:
            cell = first_cell(contract, PLACE)
            path = link.arguments[cell : cell + 2]
        altitude = flown_at(motion, 0 if motion.altitude == -1 else link.arguments[motion.altitude], policy.vehicle)
        planner = Planner(motion.kind, path, altitude, policy.vehicle.position_error)
        return PreparedLink(link, tuple(map(point, link.arguments)), require, motion.kind, planner)

    def links(self, links: tuple[Link, ...]) -> tuple[PreparedLink, ...]:
        """The links of a chain."""
        return tuple(map(self.link, links))


def _well_known(policy: Policy) -> WellKnown:
    """A slot that no signal owns is the one after the last, which is always missing."""
    vehicle, absent = policy.vehicle, policy.slots
    x, y = (absent, absent) if vehicle.position == -1 else (vehicle.position, vehicle.position + 1)
    others = (vehicle.height, vehicle.battery, vehicle.north, vehicle.east, vehicle.down)
    return WellKnown(x, y, *(absent if slot == -1 else slot for slot in others))
