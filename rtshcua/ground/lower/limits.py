"""E1001: what a policy needs fits on board. The tables there are sized once, by `rtshcua.model.flat.limits`."""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.context import Context
from rtshcua.model.flat import limits
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.policies import PolicyDecl

#: where there are too many, of what, how many, and how many fit
_Count = tuple[Span, str, int, int]


def fits(context: Context, policy: PolicyDecl, flat: Policy) -> bool:
    """Whether a lowered policy fits on board; reports each number that does not."""
    good = True
    skills = ((contract, context.symbols.skills[contract.name].name.span) for contract in flat.contracts)
    counts = [
        *_of_policy(policy.name.span, flat),
        *(count for skill, span in skills for count in _of_skill(span, skill)),
    ]
    for span, what, count, limit in counts:
        if count > limit:
            good = False
            context.report.add(
                codes.TOO_MANY,
                span,
                f"`{context.report.text(span)}` has {count:,} {what}, and at most {limit:,} fit on board",
            )
    return good


def _of_policy(span: Span, flat: Policy) -> Iterator[_Count]:
    keys = sum((len(rule.skills) or 1) * (len(rule.roles) or 1) for rule in flat.rules)
    yield span, "rules", len(flat.rules), limits.MAX_RULES
    yield span, "pairs of a skill and a role in its rules", keys, limits.MAX_RULE_KEYS
    yield span, "roles", len(flat.roles), limits.MAX_ROLES
    yield span, "skills", len(flat.contracts), limits.MAX_CONTRACTS
    yield span, "state slots for the signals that it reads", flat.slots, limits.MAX_SLOTS
    yield span, "zones, with those grown from others", len(flat.zones), limits.MAX_ZONES
    yield span, "margins by which zones of arguments grow", len(flat.tables), limits.MAX_TABLES
    yield span, "sets of values in its conditions", len(flat.sets), limits.MAX_SETS
    yield span, "temporal operators over different conditions", len(flat.monitors), limits.MAX_MONITORS
    yield span, "names of phases in its conditions", len(flat.phases), limits.MAX_PHASE_NAMES
    yield span, "values in one set", max(map(len, flat.sets), default=0), limits.MAX_MEMBERS
    corners = sum(len(zone.data) // 2 for zone in flat.zones)
    yield span, "corners of zones", corners, limits.MAX_TOTAL_VERTICES


def _of_skill(span: Span, contract: Contract) -> Iterator[_Count]:
    cells = max((parameter.cell + 2 for parameter in contract.parameters), default=0)
    yield span, "parameters", len(contract.parameters), limits.MAX_PARAMETERS
    yield span, "argument cells", cells, limits.MAX_CELLS
    for what, clauses in (
        ("`require` clauses", contract.require),
        ("`assume` clauses", contract.assume),
        ("`maintain` clauses", contract.maintain),
    ):
        yield span, what, len(clauses), limits.MAX_CLAUSES
