"""Check fallback chains: every link ends, and the last link has no precondition.

In flight, the chain of the step or the contingency is flown to its end. The fallback chain of a link's own skill is not
used. So a skill must not be in its own chain, but chains of different skills may refer to each other.
"""

from collections.abc import Sequence

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.arguments import bind_arguments
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import quantity
from rtshcua.ground.checker.lookup import find_skill
from rtshcua.model.flat.limits import MAX_LINKS
from rtshcua.model.ir.skills import LinkDecl, SkillDecl
from rtshcua.model.quantity import Dimension, display


def check_link(context: CheckContext, link: LinkDecl) -> SkillDecl | None:
    """Check and bind the arguments and the limit of one link, and return its skill; None if it is unknown."""
    skill = find_skill(context, link.skill)
    if skill is None:
        return None
    bound = bind_arguments(context, skill, link.arguments, link.span)
    if bound is not None:
        context.bind(link, bound)
    quantity(context, link.limit, Dimension.DURATION)
    _limit(context, link, skill)
    if skill.motion is not None and skill.motion.kind == "cover":
        context.report.add(
            codes.COVERING_LINK,
            link.span,
            f"`{skill.name.text}` flies a survey, which a fallback must not do",
            labels=[(skill.motion.span, "its motion")],
        )
    return skill


def check_chain(context: CheckContext, links: Sequence[LinkDecl], owner: SkillDecl | None, span: Span) -> None:
    """Report a chain that may not end; `owner` is the skill of the chain, `span` the whole chain."""
    if len(links) > MAX_LINKS:
        context.report.add(codes.TOO_MANY, span, f"the chain has {len(links)} links; the limit is {MAX_LINKS}")
    for index, link in enumerate(links):
        skill = check_link(context, link)
        if skill is None:
            continue
        if skill is owner:
            context.report.add(
                codes.CHAIN_CYCLE,
                link.skill.span,
                f"`{skill.name.text}` is in its own fallback chain",
                help="remove this link: the skill has just failed when its fallback starts",
                labels=[(skill.name.span, "the chain of this skill")],
            )
        elif index == len(links) - 1:
            _last(context, link, skill)
        else:
            check_end(context, link, skill)


def check_end(context: CheckContext, link: LinkDecl, skill: SkillDecl) -> None:
    """Report a link before the last, or a target of a `degrade`, that does not end."""
    if link.limit is None and not _ends(skill):
        context.report.add(
            codes.ENDLESS_LINK,
            link.span,
            f"`{skill.name.text}` does not end by itself, so the next link would never fly",
            help=f"add a time limit, as in `{context.report.text(link.span)} for 20 s`",
            labels=[(skill.name.span, f"`{skill.name.text}` declares no `lasts at most`")],
            fix=(link.span, f"{context.report.raw(link.span)} for 20 s", "hold for 20 s"),
        )


def _limit(context: CheckContext, link: LinkDecl, skill: SkillDecl) -> None:
    """Report a time limit above the duration of the skill."""
    limit, lasts = link.limit, skill.duration
    if limit is None or lasts is None or {limit.dimension, lasts.dimension} != {Dimension.DURATION}:
        return
    if limit.value > lasts.value:
        most = display(lasts.value, Dimension.DURATION)
        context.report.add(
            codes.INCOHERENT_TIMING,
            limit.span,
            f"the limit of the link is {display(limit.value, Dimension.DURATION)}, but `{skill.name.text}` lasts at "
            f"most {most}",
            help=f"write at most `{most}`",
            labels=[(lasts.span, "conflicts with this")],
        )


def _ends(skill: SkillDecl) -> bool:
    return skill.duration is not None or (skill.motion is not None and skill.motion.kind != "hold")


def _last(context: CheckContext, link: LinkDecl, skill: SkillDecl) -> None:
    """Check that the last link is always possible and ends on the ground."""
    needs = [*skill.require, *skill.assume]
    if needs:
        context.report.add(
            codes.NEEDY_LAST_LINK,
            link.span,
            f"the last link `{skill.name.text}` has a precondition, which may not hold",
            help="end the chain with a skill without `require` and `assume`, such as a landing on the spot",
            labels=[(need.span, "it needs this") for need in needs],
        )
    elif skill.motion is not None and skill.motion.kind != "land":
        context.report.add(
            codes.NEEDY_LAST_LINK,
            link.span,
            f"the last link `{skill.name.text}` does not land on the spot, so it needs a position",
            help="end the chain with a skill whose motion is `land`",
            labels=[(skill.motion.span, "its motion")],
        )
    elif link.limit is not None:
        context.report.add(
            codes.NEEDY_LAST_LINK,
            link.limit.span,
            "the last link cannot have a time limit",
            help="remove the limit: no link follows",
        )
