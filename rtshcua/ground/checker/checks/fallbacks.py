"""E0611 to E0613, E0615 for the fallback chains of skills."""

from rtshcua.ground.checker.chains import check_chain
from rtshcua.ground.checker.context import Context


def check_fallbacks(context: Context) -> None:
    """Report every fallback chain that might not end on the ground."""
    for skill in context.symbols.skills.values():
        if skill.fallback:
            check_chain(context, skill.fallback, skill, skill.fallback[0].span.to(skill.fallback[-1].span))
