"""E1202: what a skill records suffices to derive each decision on it again (design section 6).

Deriving again takes what was decided, every signal that was read, and on what authority; the intent and the effect say
why and what then happened, which nothing is derived from. A reflex has no authority to be asked for: it was given
beforehand, by the step that it belongs to. What was decided of it shows in what it did.

| class | must record |
|---|---|
| `semantic`, `tactical` | decision, state, authorization |
| `reflex` | decision, state, effect |

A skill that names no kind records all of it.
"""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.checks.contracts import KINDS, RECORDS
from rtshcua.ground.checker.context import Context

_ASKED = ("decision", "state", "authorization")
NEEDED = {"semantic": _ASKED, "tactical": _ASKED, "reflex": ("decision", "state", "effect")}


def check_records(context: Context) -> None:
    """Report every skill that leaves out what an auditor needs."""
    for skill in context.symbols.skills.values():
        written = {name.text for name in skill.record}
        if written.isdisjoint(KINDS) or skill.timing_class is None:
            continue
        if not written.issubset(RECORDS):
            continue  # what is misspelt may be what is missing
        missing = [f"`{name}`" for name in NEEDED.get(skill.timing_class.text, ()) if name not in written]
        if missing:
            span = skill.record[0].span.to(skill.record[-1].span)
            whole = ", ".join([context.report.raw(span), *(name.strip("`") for name in missing)])
            context.report.add(
                codes.INSUFFICIENT_EVIDENCE,
                span,
                f"`{skill.name.text}` does not record {' and '.join(missing)}, so no decision derives again",
                help=f"record {' and '.join(missing)} too, or write no `record` at all: then everything is recorded",
                labels=[(skill.timing_class.span, "what a skill of this class needs")],
                fix=(span, whole, "record it too"),
            )
