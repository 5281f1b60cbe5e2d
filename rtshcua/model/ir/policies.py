"""Authority policies: who may have which skill done, where and when."""

from typing import Literal

from rtshcua.model.ir.expression import Condition, Quantity
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.skills import LinkDecl


class Rule(Node):
    """`permit`, `forbid`, `confirm` or `degrade`.

    Empty `skills` is `any`. `roles` empty is `by any`. `through` are the sources that may speak for the role
    (`through agent`); empty means the role's own source, `operator`, except under `by any`, where it means every
    source.
    """

    kind: Literal["permit", "forbid", "confirm", "degrade"]
    skills: tuple[Name, ...]
    roles: tuple[Name, ...]
    through: tuple[Name, ...]
    when: Condition | None
    approver: Name | None  # confirm: `by role supervisor`
    within: Quantity | None  # confirm: `within 30 s`
    target: LinkDecl | None  # degrade: `to return_home`


class Airspace(Node):
    """`airspace inside city outside school, hospital`: where the vehicle may be at all."""

    inside: tuple[Name, ...]
    outside: tuple[Name, ...]


class PolicyDecl(Node):
    """`policy name version 7 { ... }`. `contingency` flies when a step is denied in the air."""

    name: Name
    version: int
    rules: tuple[Rule, ...]
    airspace: Airspace | None
    contingency: tuple[LinkDecl, ...]
