"""A mission: its steps with every argument, and where a step is held to more than its skill."""

from rtshcua.app.wording import utc
from rtshcua.front.cli.showing import words
from rtshcua.front.cli.showing.contract import fields
from rtshcua.front.cli.showing.page import Page
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible
from rtshcua.model.flat.policy import Policy
from rtshcua.model.step_number import number_of


def show_mission(page: Page, mission: Mission, policy: Policy) -> None:
    """Adds a mission to the page."""
    page.head(f"Mission {mission.name}")
    page.row("intent", mission.intent or "not said")
    page.row("proposed by", mission.proposer or "a person")
    page.row("vehicle", f"`{mission.vehicle}`")
    page.row("policy", f"{mission.policy} version {mission.policy_version}, digest {mission.policy_digest.hex()}")
    page.row("issued", utc(mission.issued_at_us))
    page.rows("sources", mission.sources)
    phase = -1
    for invocation in mission.invocations:
        if invocation.phase != phase:
            phase = invocation.phase
            page.head(f"Phase {mission.phases[phase]}")
        _show_step(page, invocation, mission, policy)


def _show_step(page: Page, step: Invocation, mission: Mission, policy: Policy) -> None:
    contract = step.contract
    page.text(
        f"{number_of(step.step):>2} {contract.name}({words.arguments(policy, contract.parameters, step.arguments)})"
    )
    phases = [name for number, name in enumerate(mission.phases) if step.phases >> number & 1]
    rows = [
        ("asked by", f"role {policy.roles[step.role]} through {words.source(step.source)}"),
        ("goes", words.plan(policy, step.plan)),
        ("valid", f"until {utc(step.issued_at_us + contract.validity_us)}, during {', '.join(phases)}"),
        ("otherwise", f"{OnInadmissible(step.on_inadmissible).name.lower()}, when it is not admitted in the air"),
        ("id", step.invocation_id.hex()),
        ("binding", step.binding.hex()),
        *_tightened(step, policy),
    ]
    for name, value in rows:
        page.row(name, value, indent=6, width=9)


def _tightened(step: Invocation, policy: Policy) -> list[tuple[str, str]]:
    """How the step's contract differs from its skill's."""
    own, skill = fields(policy, step.contract), fields(policy, policy.contracts[step.skill])
    if own == skill:
        return [("contract", "the skill's own")]
    return [("contract", "tighter than the skill's in:"), *(each for each in own if each not in skill)]
