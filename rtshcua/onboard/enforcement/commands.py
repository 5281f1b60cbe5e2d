"""The commands of a bundle: what a permit's kind, step and link stand for. Built from verified parts alone."""

from collections.abc import Sequence

from rtshcua.model.flat.contract import PLACE, Contract, Link, MotionKind
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import unproject
from rtshcua.onboard.ports import Command
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP

#: a command but for its token
_Made = tuple[str, int, tuple[int, ...], tuple[int, ...], int, int, int]


class Commands:
    """Looks up the command of a step or a link. Raises `LookupError` for one that the bundle does not have.

    `recalled` says that no step may be sent any more. Only the boundary changes it, and the steps.
    """

    def __init__(self, policy: Policy, mission: Mission) -> None:
        self.recalled = False
        self._policy = policy
        self._links: dict[tuple[int, int, int], _Made] = {}
        self.replace(mission)

    def replace(self, mission: Mission) -> None:
        """From now on these are the steps. What its links are is made now, for when one must fly there is no time."""
        self._steps = self._located(mission)
        policy = self._policy
        self._links = {
            (CONTINGENCY_LINK, -1, number): self._of_link(link) for number, link in enumerate(policy.contingency)
        }
        targets = [(-1 - rule, each.target) for rule, each in enumerate(policy.rules) if each.target is not None]
        made = {number: self._of_link(target) for number, target in targets}
        for step, (invocation, _) in enumerate(self._steps):
            for number, link in enumerate(invocation.contract.fallback):
                self._links[FALLBACK_LINK, step, number] = self._of_link(link)
            for number, fields in made.items():
                self._links[FALLBACK_LINK, step, number] = fields

    def _located(self, mission: Mission) -> tuple[tuple[Invocation, tuple[int, ...]], ...]:
        return tuple((invocation, self._geo(invocation.plan.path)) for invocation in mission.invocations)

    def command(self, kind: int, step: int, link: int, token: int) -> Command:
        """The command, under the token of its permit. A `link` of `-1 - rule` is the target of that degrade rule."""
        if kind == STEP:
            return self._of_step(step, token)
        return Command(token, *self._links[kind, step if kind == FALLBACK_LINK else -1, link])

    def _of_step(self, step: int, token: int) -> Command:
        invocation, geo = self._steps[_index(step)]
        plan, contract = invocation.plan, invocation.contract
        held_us = hold_us(contract, invocation.arguments)
        return Command(token, contract.name, plan.kind, plan.path, geo, plan.altitude, plan.speed, held_us)

    def _of_link(self, link: Link) -> _Made:
        contract = self._policy.contracts[link.skill]
        motion = contract.motion
        path: tuple[int, ...] = ()
        if motion.kind == MotionKind.FLY:
            cell = next(parameter.cell for parameter in contract.parameters if parameter.kind == PLACE)
            path = link.arguments[cell : cell + 2]
        altitude, speed = (link.arguments[cell] if cell >= 0 else 0 for cell in (motion.altitude, motion.speed))
        held_us = 0 if link.limit_us else hold_us(contract, link.arguments)  # the link's own time counts
        return contract.name, motion.kind, path, self._geo(path), altitude, speed, held_us

    def _geo(self, path: Sequence[int]) -> tuple[int, ...]:
        projection = self._policy.projection
        return tuple([part for x, y in zip(path[::2], path[1::2], strict=True) for part in unproject(projection, x, y)])


def hold_us(contract: Contract, arguments: tuple[int, ...]) -> int:
    """How long a skill is to hold (`hold for time`), 0 where it does not say."""
    return arguments[contract.motion.time] if contract.motion.time >= 0 else 0


def _index(number: int) -> int:
    """A list index as a request may give it; Python's own negative ones would name another step."""
    if number < 0:
        raise LookupError(f"no number {number}")
    return number
