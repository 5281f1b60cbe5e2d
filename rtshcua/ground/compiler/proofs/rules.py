"""E0720 to E0723: rules that are dead, shadowed, redundant or in the way of each other."""

from rtshcua.ground.compiler.proofs import bundles, conflicting, redundant
from rtshcua.ground.compiler.proofs.dead import dead
from rtshcua.ground.compiler.proofs.ruleset import Ruleset
from rtshcua.ground.compiler.proofs.situation import Ground


def prove(ground: Ground) -> None:
    """Report what no rule should be; a dead rule is reported as that alone."""
    rules = Ruleset(ground)
    alive = [group for group in rules.groups if not dead(rules, group)]
    alive = [group for group in alive if group.span not in rules.open]
    gone = redundant.prove(rules, alive)
    bundles.prove(rules, alive, gone)
    conflicting.prove(rules, [group for group in alive if gone.isdisjoint(group.rules)])
