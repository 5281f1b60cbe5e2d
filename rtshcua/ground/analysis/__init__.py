"""What conditions mean together: whether some situation gives each of several conditions a wanted truth.

    space = space_of(prepared, contract)
    answer = satisfiable([(node, TRUE), (other, FALSE | UNKNOWN)], space)

`node` is a tree of `rtshcua.decision.tree` (`prepared.compiler.when(rule)`, `prepared.compiler.node(clause, contract)`,
or trees joined by `tree.Both` and its like), the second of each pair the set of truths that will do, and `space` what
the situation may be: `space_of` says any that can be met, `replace` narrows it. The answer is `Yes` with a witness that
the decision's own evaluator has confirmed, `No`, which is a proof, or `Undecided` where the budget was used up or no
place was found. `implies(node, other, space)` asks whether `other` is true wherever `node` is; its `No` has the
witness against it.

The search is by branch and bound: a *box* holds a set of values for everything that the conditions read; the conditions
are evaluated over it by the rules of `rtshcua.decision`; where that leaves more than one truth, the box is split at a
threshold of an atom that it does not decide. Sums of several variables are variables of their own, tied to their parts
by interval arithmetic. Whether a place is inside a zone is one variable for each zone; which of them go together is
proved by the zones' relations, or shown by a place.
"""
