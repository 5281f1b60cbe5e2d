"""Which step of a flight waits for an approver, by the flight's records. Nothing here reads a clock or a socket."""

from base64 import b64decode
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from rtshcua.app.telling.document_prose import said
from rtshcua.evidence.records import DecisionRecord, Effect
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.outcome import Reason
from rtshcua.wire.approval import ApprovalDocument
from rtshcua.wire.request import STEP
from rtshcua.wire.untrusted import Untrusted

#: effects that end every question
_ENDS: Final = frozenset({"recall", "cancellation", "taken-over", "crashed", "stood-down"})
#: why a step waits no longer, by the reason of its next decision
_DECIDED: Final = {
    "admitted": "the step was approved",
    Reason.APPROVAL_TIMED_OUT.value: "nobody answered in time, so the step was denied",
}


class AskedStep(NamedTuple):
    """A step that waits for the approver: `number` counts the questions, `step` is the index of the step, `missing` are
    the roles that are awaited. `until_us` is monotonic time of the flight.
    """

    number: int
    step: int
    invocation: str
    binding: str
    rule: str
    missing: tuple[str, ...]
    until_us: int


def asked_roles(policy: Policy) -> tuple[str, ...]:
    """The roles that the `confirm` rules of a policy name, in the order of the policy."""
    rules = [rule for rule in policy.rules if rule.kind == RuleKind.CONFIRM]
    numbers = {number for rule in rules for number in (rule.approver, rule.second)}
    return tuple(name for number, name in enumerate(policy.roles) if number in numbers)


class OpenQuestions:
    """Follows the records of a flight; `current` is the step that waits for a person in a role. A flight requests one
    step at a time, so there is one question at most. `people` are the owners of approval keys; each question takes one
    of `numbers`.
    """

    def __init__(
        self, policy: Policy, person: str, role: str, people: Mapping[bytes, str], numbers: Iterator[int]
    ) -> None:
        self._policy, self._person, self._role, self._people = policy, person, role, people
        self._numbers = numbers
        self._waits: DecisionRecord | None = None  # the latest decision, if its step waits for anybody
        # invocation, role and person of each grant, and until when it is valid
        self._agreed: list[tuple[str, str, str, int]] = []
        self.current: AskedStep | None = None

    def take(self, record: DecisionRecord | Effect) -> str:
        """Take the next record; return why it closed the question, or an empty text. A new one is in `current`."""
        before = self.current
        why = self._decided(record) if isinstance(record, DecisionRecord) else self._happened(record)
        return "" if before is None or before == self.current else why

    def ask_again(self) -> None:
        """Make a new question of the current one, because what it is about changed."""
        if self.current is not None:
            self.current = self.current._replace(number=next(self._numbers))

    def _decided(self, record: DecisionRecord) -> str:
        if record.kind == STEP and record.reason == Reason.AWAITING_APPROVAL.value:
            self._waits = record
            return self._look("the step waits for somebody else")
        if self._waits is None or record.step != self._waits.step:
            return ""
        other = f"the step was decided otherwise: {record.outcome}, {record.reason}"
        return self._over(_DECIDED.get(record.reason, other) if record.kind == STEP else "its fallback flies")

    def _happened(self, record: Effect) -> str:
        if record.event == "approval":
            return self._answered(record.detail)
        waits = self._waits
        if waits is None or record.event == "repeated":
            return ""
        if record.event == "replacement" and record.step > waits.step:
            self.ask_again()  # the step stays, in another mission: an answer has to name that one
            return "the rest of the mission was replaced"
        if record.event == "replacement" or record.event in _ENDS or record.step == waits.step:
            return self._over(f"overtaken by `{record.event}`")
        return ""

    def _over(self, why: str) -> str:
        self._waits = self.current = None
        return why

    def _answered(self, detail: str) -> str:
        """Take an answer that the flight accepted."""
        try:
            document = said(b64decode(detail, validate=True))
        except (ValueError, Untrusted):
            return ""
        body = document.body
        if not isinstance(body, ApprovalDocument):
            return ""
        who, invocation = self._people.get(document.kid, "somebody"), body.invocation_id.hex()
        if not body.granted:
            is_mine = self._waits is not None and self._waits.invocation == invocation
            return self._over(f"{who} refused it as {body.role}") if is_mine else ""
        self._agreed.append((invocation, body.role, who, body.expires_at_us))
        return self._look(f"{who} approved it as {body.role}")

    def _look(self, why: str) -> str:
        """Find out whether the waiting step waits for the approver; return `why` that changed."""
        record, before, self.current = self._waits, self.current, None
        if record is None:
            return why
        for number, rule in enumerate(self._policy.rules):
            asks = rule.kind == RuleKind.CONFIRM and rule.text == record.clause
            if asks and self._role in (missing := self._missing(record, number)):
                until_us = record.context.released_us + rule.within_us
                asked = record.step, record.invocation, record.binding, rule.text, missing, until_us
                same = before is not None and before[1:] == asked
                self.current = before if same else AskedStep(next(self._numbers), *asked)
                break
        return why

    def _missing(self, record: DecisionRecord, number: int) -> tuple[str, ...]:
        """The roles that a rule still awaits; none if the approver has agreed already: two people must."""
        roles, rule = self._policy.roles, self._policy.rules[number]
        missing = [roles[each] for each in (rule.approver, rule.second) if each >= 0]
        agreed = [
            (role, who)
            for of, role, who, until_us in self._agreed
            if of == record.invocation and role in missing and until_us > record.utc_us
        ]
        if any(who == self._person for _, who in agreed):
            return ()
        for role in [role for role, _ in agreed] or self._earlier(record, number):
            if role in missing:
                missing.remove(role)
        return tuple(missing)

    def _earlier(self, record: DecisionRecord, number: int) -> list[str]:
        """The roles of the grants for a rule in a decision, whose persons are numbers of the flight's own root."""
        given = [role for rule, role, granted, _, _ in record.context.approvals if rule == number and granted]
        return [name for role in given for name in self._policy.roles[role : role + 1]]
