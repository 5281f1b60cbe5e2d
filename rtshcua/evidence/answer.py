"""What a decision record answers, in the words of a log: on board, and in an audit that derives it again."""

import msgspec

from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.outcome import Outcome, Reason

_OUTCOMES = tuple(outcome.name.lower() for outcome in Outcome)  # by number


class RecordedAnswer(msgspec.Struct, frozen=True, gc=False):
    """What was decided, field by field as in `records.Decision`."""

    outcome: str
    reason: str
    rule_step: int
    clause: str | None
    clause_at: tuple[int, int, int] | None
    target: str | None
    target_link: int
    valid_until_us: int

    @classmethod
    def of(
        cls, outcome: Outcome, reason: Reason, rule_step: int, valid_until_us: int,
        *, clause: Clause | Rule | Airspace | None = None, target: Link | None = None, target_link: int = -1,
    ) -> "RecordedAnswer":  # fmt: skip
        """An answer in the words of a log: `clause` decided, `target` flies instead, and `target_link` is its index."""
        return cls(
            _OUTCOMES[outcome],
            reason._value_,  # `value` is a property in Python, and slow
            rule_step,
            None if clause is None else clause.text,
            None if clause is None else (clause.source, clause.start, clause.end),
            None if target is None else target.text,
            target_link,
            valid_until_us,
        )
