"""E1204, E1205: how durable a skill's records are to be, one word for each skill, and the least only for a reflex.

A record that is merely buffered is gone with the process. A reflex has no time to wait for its record; whatever else is
decided has, and what moved the vehicle must not be what nobody can look up.
"""

from collections.abc import Sequence

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.context import Context
from rtshcua.model.durability import BUFFERED, WORDS, WRITTEN
from rtshcua.model.ir.node import Name


def check_durability(context: Context) -> None:
    """Report every skill whose `record` asks for two durabilities, or for less than its class may have."""
    for skill in context.symbols.skills.values():
        words = durability(context, skill.record)
        if words is None or words.text != WORDS[BUFFERED] or skill.timing_class is None:
            continue
        if skill.timing_class.text != "reflex":
            context.report.add(
                codes.FLEETING_EVIDENCE,
                words.span,
                f"`{skill.name.text}` is no reflex, and its records would be lost with the process",
                help=f"write `{WORDS[WRITTEN]}` or more, or leave the word out: then it is `synced`",
                labels=[(skill.timing_class.span, "`buffered` is for reflexes alone")],
                fix=(words.span, WORDS[WRITTEN], f"write `{WORDS[WRITTEN]}`"),
            )


def durability(context: Context, record: Sequence[Name]) -> Name | None:
    """The word for the durability among those of a `record` clause; reports a second one that is another."""
    words = [name for name in record if name.text in WORDS]
    other = next((name for name in words if name.text != words[0].text), None)
    if other is not None:
        context.report.add(
            codes.TWO_DURABILITIES,
            other.span,
            f"records cannot be both `{words[0].text}` and `{other.text}`",
            help=f"write one of them; {listed(WORDS)} go from least to most",
            labels=[(words[0].span, "asked for here")],
        )
        return None
    return words[0] if words else None
