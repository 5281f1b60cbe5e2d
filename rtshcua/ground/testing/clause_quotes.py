"""Finds the clause that a test quotes among those that can decide."""

from collections.abc import Iterable, Iterator, Sequence
from difflib import SequenceMatcher
from typing import NamedTuple

from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.lower.tables import shortened
from rtshcua.ground.testing.case import PolicyUnderTest
from rtshcua.ground.testing.coverage_goals import clauses_of
from rtshcua.model.decision import Decisive
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.ir.tests import Expectation

#: stands for the rest of a clause, so that a long one need not be quoted in full
REST = "..."
MAX_SHOWN = 6


class _Candidate(NamedTuple):
    """A clause that can decide, with its role and its full text on one line."""

    role: str
    text: str
    clause: Decisive


def quotes(quoted: str, text: str) -> bool:
    """Whether a text quotes a clause: in full, or its beginning before `...`. White space is ignored."""
    words = _spaced(quoted)
    if words.endswith(REST):
        start = words.removesuffix(REST).rstrip()
        return start != "" and text.startswith(start)
    return text == words


def quoted_clauses(
    context: CheckContext, expected: Expectation, invocation: PreparedInvocation, policy: PolicyUnderTest
) -> tuple[Decisive, ...]:
    """Return the clause that an expectation quotes, in all its flat forms; empty if it quotes none.

    A quotation that no clause can match, or more than one, is reported, and the result is empty.
    """
    quoted = expected.clause
    if quoted is None:
        return ()
    every = list(_decisive(invocation, policy))
    fitting = [each for each in every if quotes(quoted.text, each.text)]
    if not fitting:
        _unknown(context, expected, invocation, every)
        return ()
    several = {each.text for each in fitting} if expected.reason is not None else {each[:2] for each in fitting}
    if len(several) > 1:
        _ambiguous(context, expected, fitting)
        return ()
    return tuple(each.clause for each in fitting)


def _unknown(
    context: CheckContext, expected: Expectation, invocation: PreparedInvocation, every: Sequence[_Candidate]
) -> None:
    quoted = expected.clause
    assert quoted is not None
    near, help = clause_meant(quoted.text, dict.fromkeys(shortened(each.text) for each in every))
    message = "the quotation is empty"
    if quoted.text.strip(". "):
        skill = invocation.invocation.contract.name
        message = f"no clause `{shortened(quoted.text)}` can decide on `{skill}` here"
    context.report.add(
        codes.UNKNOWN_CLAUSE,
        quoted.span,
        message,
        help=help,
        fix=None if near is None or '"' in near else (quoted.span, f'"{near}"', "quote this clause"),
    )


def clause_meant(quoted: str, texts: Iterable[str]) -> tuple[str | None, str]:
    """Return the clause that a wrong quotation probably means, or None, and the help."""
    every = list(texts)
    near = _nearest(_spaced(quoted), every)
    if near is not None:
        return near, f"did you mean `{near}`?"
    likely = sorted(every, key=lambda text: -SequenceMatcher(None, _spaced(quoted), text).ratio())
    return None, f"possible clauses: {shown_clauses(likely)}" if likely else "no clause decides here"


def _nearest(words: str, texts: Sequence[str]) -> str | None:
    """The clause nearest to a quotation, or its beginning. A quoted beginning is compared with beginnings."""
    begun = words.endswith(REST)
    start = words.removesuffix(REST).rstrip()
    if not start:
        return None
    length = len(start.split())
    begins = {text: " ".join(text.split()[:length]) for text in texts}
    if not begun:
        if sum(begin == start for begin in begins.values()) == 1:
            return f"{start} {REST}"
        return nearest(words, texts)
    near = nearest(start, begins.values())
    if near is None:
        return None
    fitting = [text for text, begin in begins.items() if begin == near]
    return f"{near} {REST}" if len(fitting) == 1 else fitting[0]


def _ambiguous(context: CheckContext, expected: Expectation, fitting: Sequence[_Candidate]) -> None:
    quoted = expected.clause
    assert quoted is not None
    texts = list(dict.fromkeys(shortened(each.text) for each in fitting))
    alike = len(texts) == 1
    roles = list(dict.fromkeys(each.role for each in fitting))
    context.report.add(
        codes.UNKNOWN_CLAUSE,
        quoted.span,
        f"`{shortened(quoted.text)}` quotes {'more than one clause' if alike else 'the beginning of several clauses'}"
        f" that can decide here",
        help=f"add the reason with `because`: the clause is in {shown_clauses(roles)}"
        if alike
        else f"quote more of one: {shown_clauses(texts)}",
    )


def shown_clauses(texts: Sequence[str]) -> str:
    """List the first clauses for a message."""
    return ", ".join(f"`{text}`" for text in texts[:MAX_SHOWN]) + (", ..." if len(texts) > MAX_SHOWN else "")


def _decisive(invocation: PreparedInvocation, policy: PolicyUnderTest) -> Iterator[_Candidate]:
    """Yield all clauses that can decide on a request."""
    contract = invocation.invocation.contract
    for role, clause in clauses_of(contract):
        yield _Candidate(role, _spaced(policy.text(clause)), clause)
    for rules in invocation.candidates:
        for rule in rules:
            yield _Candidate(RuleKind(rule.rule.kind).name.lower(), _spaced(policy.text(rule.rule)), rule.rule)
    airspace = policy.prepared.policy.airspace
    if airspace is not None:
        yield _Candidate("airspace", _spaced(policy.text(airspace)), airspace)


def _spaced(text: str) -> str:
    return " ".join(text.split())
