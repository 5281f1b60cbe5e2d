"""Decides whether some situation gives each of several conditions a wanted truth value.

    space = space_of(prepared, contract)
    answer = satisfiable([(node, TRUE), (other, FALSE | UNKNOWN)], space)

`node` is a tree of `rtshcua.decision.tree` (`prepared.compiler.when(rule)`, `prepared.compiler.node(clause, contract)`,
or trees joined by connectives such as `tree.Both`). The second element of each pair is the set of wanted truth values.
`space` is the set of possible situations: `space_of` returns all of them, and `_replace` narrows them. The answer is
`Yes` with a witness that the decision's own evaluator has confirmed, `No`, which is a proof, or `Undecided` if the
budget was used up or no place was found. `implies(node, other, space)` decides whether `other` is true wherever `node`
is: `No` is the proof, and `Yes` has a counterexample.

The search is by branch and bound. A *box* holds a set of values for everything that the conditions read, and the rules
of `rtshcua.decision` evaluate the conditions over it. If more than one truth value is possible, the box is split at a
threshold of an undecided atom. A sum of several variables is a variable of its own, tied to its parts by interval
arithmetic. For each zone, one variable holds whether a place is inside it. The relations of the zones prove which of
these values are possible together, or a place shows it.
"""
