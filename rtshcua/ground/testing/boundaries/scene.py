"""One situation to vary: an invocation, a state, the time and where the mission stands."""

from dataclasses import replace as changed
from typing import NamedTuple, TypeAlias

from msgspec.structs import replace

from rtshcua.decision.contracts import first_cell, misfit
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.situation import environment, situation
from rtshcua.decision.values import point
from rtshcua.decision.volume import Planner, flown_at, near_home
from rtshcua.model.flat.contract import PLACE, MotionKind
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.situation import Context, Now, State

#: a value of a variable: one integer, the two of a place (local mm), or None for a signal that is missing
Value: TypeAlias = int | tuple[int, int] | None


class Variable(NamedTuple):
    """An argument cell or a state slot (of a place the first of two), or the time (`at` is None), as in `Change`."""

    argument: bool
    at: int | None


TIME = Variable(False, None)
Made: TypeAlias = dict[Variable, Value]


class Scene(NamedTuple):
    """What is decided on."""

    invocation: PreparedInvocation
    state: State
    context: Context
    now: Now

    def environment(self) -> Environment:
        """As conditions read it."""
        invocation = self.invocation
        sets = situation(self.state, invocation.policy, self.now)
        return environment(sets, invocation.policy, invocation.arguments, invocation.phase)

    def value(self, variable: Variable) -> int | None:
        """The present value of a variable that is one integer."""
        if variable.at is None:
            return self.now.utc_us
        if variable.argument:
            return self.invocation.invocation.arguments[variable.at]
        return self.state.values[variable.at]

    def place(self, variable: Variable) -> tuple[int, int] | None:
        """The present place of a variable that is one."""
        assert variable.at is not None
        cells = self.invocation.invocation.arguments if variable.argument else self.state.values
        x, y = cells[variable.at : variable.at + 2]
        return None if x is None or y is None else (x, y)

    def put(self, variable: Variable, value: Value) -> "Scene":
        """The same with another value; what was issued and released so long ago still was."""
        if variable.at is None:
            assert isinstance(value, int)
            flat = self.invocation.invocation
            issued = flat.issued_at_us + value - self.now.utc_us
            moved = changed(self.invocation, invocation=replace(flat, issued_at_us=issued))
            return self._replace(invocation=moved, now=replace(self.now, utc_us=value))
        new: tuple[int | None, ...] = value if isinstance(value, tuple) else (value,)
        if variable.argument:
            cells = list(self.invocation.invocation.arguments)
            cells[variable.at : variable.at + len(new)] = [each for each in new if each is not None]
            return self._replace(invocation=replanned(self.invocation, tuple(cells)))
        values = list(self.state.values)
        if value is None and variable.at == self.invocation.policy.policy.vehicle.position:
            new = (None, None)
        values[variable.at : variable.at + len(new)] = new
        return self._replace(state=replace(self.state, values=tuple(values)))

    def with_all(self, made: Made) -> "Scene":
        """The same with other values."""
        scene = self
        for variable, value in made.items():
            scene = scene.put(variable, value)
        return scene


def replanned(invocation: PreparedInvocation, arguments: tuple[int, ...]) -> PreparedInvocation:
    """The invocation with other arguments. Its plan follows, but for the path of a survey, which stays what it was."""
    flat, vehicle = invocation.invocation, invocation.policy.policy.vehicle
    contract = flat.contract
    motion, plan = contract.motion, flat.plan
    path = plan.path
    if motion.kind == MotionKind.FLY:
        cell = first_cell(contract, PLACE)
        path = arguments[cell : cell + 2]
    altitude = plan.altitude if motion.altitude == -1 else arguments[motion.altitude]
    speed = plan.speed if motion.speed == -1 else arguments[motion.speed]
    plan = replace(plan, path=path, altitude=altitude, speed=speed)
    planned: Invocation = replace(flat, arguments=arguments, plan=plan)
    flown = flown_at(motion, altitude, vehicle)
    planner = Planner(plan.kind, path, flown, vehicle.position_error, near_home(vehicle))
    return changed(
        invocation,
        invocation=planned,
        arguments=tuple(map(point, arguments)),
        misfit=misfit(arguments, contract),
        planner=planner,
    )
