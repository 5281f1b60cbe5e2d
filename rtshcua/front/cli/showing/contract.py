"""A skill contract, with nothing left unsaid."""

from collections.abc import Sequence

from rtshcua.front.cli.showing import words
from rtshcua.front.cli.showing.page import Page
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, TimingClass
from rtshcua.model.flat.policy import Policy

_NOTHING = "nothing"


def show_contract(page: Page, policy: Policy, contract: Contract) -> None:
    """Adds a contract to the page."""
    parameters = [words.parameter(policy, parameter) for parameter in contract.parameters]
    page.text(f"{contract.name}({'' if parameters else ')'}")
    for parameter in parameters:
        page.text(parameter + ",", indent=6)
    if parameters:
        page.text(")")
    for name, value in fields(policy, contract):
        page.row(name, value, indent=6, width=9)


def fields(policy: Policy, contract: Contract) -> list[tuple[str, str]]:
    """The fields but for the parameters, by the words of the language; a name is empty where it goes on."""
    during = f" during {', '.join(contract.phases)}" if contract.phases else ", in any phase"
    chain = [f"{n} {words.link(policy, link)}" for n, link in enumerate(contract.fallback)]
    left_out = [
        f"{clause.part} {clause.text}: the vehicle is without a sensor for it"
        for clause in policy.left_out
        if clause.skill >= 0 and policy.contracts[clause.skill].name == contract.name
    ]
    return [
        ("motion", words.motion(contract)),
        ("class", TimingClass(contract.timing_class).name.lower()),
        ("deadline", f"{words.duration(contract.deadline_us)} after release"),
        ("valid", f"for {words.duration(contract.validity_us)} after issue{during}"),
        ("lasts", f"at most {words.duration(contract.duration_us)}"),
        ("grace", f"{words.duration(contract.grace_us)}: how long a signal may be unknown while it runs"),
        *_list("require", _texts(contract.require)),
        *_list("assume", _texts(contract.assume)),
        *_list("maintain", _texts(contract.maintain)),
        *(_list("left out", left_out) if left_out else ()),
        *_list("fallback", chain),
        ("energy", f"at most {words.ratio(contract.energy)}"),
        ("record", ", ".join(contract.record) or _NOTHING),
    ]


def _texts(clauses: Sequence[Clause]) -> list[str]:
    return [clause.text for clause in clauses]


def _list(name: str, values: Sequence[str]) -> list[tuple[str, str]]:
    return [(name if number == 0 else "", value) for number, value in enumerate(values or [_NOTHING])]
