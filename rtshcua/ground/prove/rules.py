"""E0720 to E0723, E1102: rules that are dead, always hold, are shadowed, redundant or in the way of each other."""

from rtshcua.diagnostics import codes
from rtshcua.ground.prove import bundles, conflicting, redundant
from rtshcua.ground.prove.dead import always, dead
from rtshcua.ground.prove.ruleset import MOST_EFFORT, Ruleset
from rtshcua.ground.prove.situation import Ground


def prove(ground: Ground) -> None:
    """Report what no rule should be; a dead rule is reported as that alone."""
    rules = Ruleset(ground)
    alive = [group for group in rules.groups if not dead(rules, group) and group.span not in rules.open]
    living = {number for group in alive for number in group.rules}
    rules.drop(number for group in rules.groups for number in group.rules if number not in living)
    for group in alive:
        always(rules, group)
    gone = redundant.prove(rules, alive)
    bundles.prove(rules, alive, gone)
    conflicting.prove(rules, [group for group in alive if gone.isdisjoint(group.rules)])
    if rules.exhausted:
        declared = ground.lowered.declaration
        ground.context.report.add(
            codes.UNDECIDED,
            declared.name.span,
            f"the rules of `{declared.name.text}` were not all compared with each other: "
            f"after {MOST_EFFORT:,} steps that is given up",
            help="rules that are dead, shadowed, redundant or in conflict may not have been reported; "
            "fewer rules, or simpler conditions, would do",
        )
