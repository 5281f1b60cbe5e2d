"""E0618: the last link of a chain does its work in the state in which it is reached.

That state is the worst: no signal tells anything any more, and of the battery only the reserve is left, for that is
what a reserve is kept for. So the link's skill must take no more than the reserve, maintain nothing that then is
unknown, and last long enough to come down from as high as the mission goes. That it is a landing, requires and assumes
nothing, and has no time limit as a link, is E0612.
"""

from collections.abc import Iterator, Sequence

from rtshcua.decision.evaluate import Environment
from rtshcua.decision.flying import BEGINS, SETTLES, charge, landing_us
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.tree import slots_read
from rtshcua.decision.values import MISSING, TRUE, point
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.flat.contract import Link, MotionKind
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display

_SECOND_US = 1_000_000


def prove(ground: Ground) -> None:
    """Report each skill that ends a chain of the policy and cannot in the worst state, once."""
    policy = ground.prepared.policy
    chains = [policy.contingency, *(contract.fallback for contract in policy.contracts)]
    reported: set[int] = set()
    for chain in chains:
        if chain and chain[-1].skill not in reported:
            for words, help, span, label in _lacks(ground, chain[-1]):
                reported.add(chain[-1].skill)
                _report(ground, ground.span(chain[-1]), words, help, [(span, label)])


def _lacks(ground: Ground, link: Link) -> Iterator[tuple[str, str, Span, str]]:
    """What a last link lacks, what would help, and where that is written."""
    policy = ground.prepared.policy
    contract, reserve = policy.contracts[link.skill], policy.vehicle.reserve
    skill = ground.context.symbols.skills[contract.name]
    if contract.energy > reserve:
        assert skill.energy is not None
        yield (
            f"the last link `{contract.name}` may take {_percent(contract.energy)} of the charge, and what is kept for "
            f"it is the reserve of `{policy.vehicle.name}`, {_percent(reserve)}",
            "raise the vehicle's `reserve`, or end the chain in a skill that takes less",
            skill.energy.span,
            "it may take so much",
        )
    any_time = ground.sets()
    nothing = Environment(
        [MISSING] * (policy.slots + 1), tuple(map(point, link.arguments)), any_time.utc_us, any_time.utc_error_us
    )
    for clause, condition in ground.prepared.compiler.guards(contract.maintain, contract):
        if slots_read((clause,), policy.vehicle, policy.monitors) and not condition(nothing) & TRUE:
            yield (
                f"the last link `{contract.name}` maintains `{clause.text}`, which is unknown when no signal arrives",
                "end the chain in a skill that maintains nothing, for then nothing is left to fall back on",
                ground.span(clause),
                "it is to maintain this",
            )


def prove_height(ground: Ground, steps: Sequence[Step], invocations: Sequence[PreparedInvocation]) -> None:
    """Report the last links that may not be down from the highest step in the time, or with the charge, that they have.

    A return climbs before it can be broken off, so its height counts too.
    """
    policy = ground.prepared.policy
    vehicle, speeds = policy.vehicle, policy.vehicle.speeds
    assert speeds is not None  # the compiler writes them
    heights = [one.invocation.plan.altitude for one in invocations]
    chains = [policy.contingency, *(one.invocation.contract.fallback for one in invocations)]
    returns = any(policy.contracts[link.skill].motion.kind == MotionKind.HOME for chain in chains for link in chain)
    highest = max(*heights, vehicle.return_altitude if returns else 0)
    needed = BEGINS + SETTLES + landing_us(speeds, highest)
    for skill, link in {chain[-1].skill: chain[-1] for chain in chains if chain}.items():
        contract = policy.contracts[skill]
        declared = ground.context.symbols.skills[contract.name]
        takes = f"from {display(highest, Dimension.ALTITUDE)} the last link `{contract.name}` takes up to "
        if 0 < contract.duration_us < needed:
            assert declared.duration is not None
            words = (
                f"{takes}{display(-(-needed // _SECOND_US) * _SECOND_US, Dimension.DURATION)} to come down, and it "
                f"lasts at most {display(contract.duration_us, Dimension.DURATION)}"
            )
            help, written = "let it last longer, or stay lower", declared.duration.span
        elif charge(speeds, needed) > contract.energy:
            assert declared.energy is not None
            words = (
                f"{takes}{_percent(-(-charge(speeds, needed) // 10) * 10)} of a full charge to come down, and it takes "
                f"at most {_percent(contract.energy)}"
            )
            help, written = "let it take more, or stay lower", declared.energy.span
        else:
            continue
        labels = [(written, "declared here"), (ground.span(link), "the last link of a chain")]
        _report(ground, steps[heights.index(max(heights))].span, words, help, labels)


def _report(ground: Ground, span: Span, words: str, help: str, labels: list[tuple[Span, str]]) -> None:
    ground.context.report.add(codes.INFEASIBLE_LAST_LINK, span, words, help=help, labels=labels)


def _percent(charge: int) -> str:
    return display(charge, Dimension.RATIO)
