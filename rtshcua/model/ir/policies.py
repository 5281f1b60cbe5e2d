"""Authority policies: who may use which skill, where and when."""

from typing import Literal

from rtshcua.model.ir.expression import Condition, Quantity
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.skills import ArgumentValue, LinkDecl, ParameterDecl


class RoleDecl(Node):
    """`role supervisor, trainee`: roles that rules may name. `operator` is a role without a declaration."""

    names: tuple[Name, ...]


class RuleDecl(Node):
    """`permit`, `forbid`, `confirm` or `degrade`.

    Empty `skills` is `any`. `roles` empty is `by any`. `through` are the sources that may act for the role
    (`through agent`); empty means the role's own source, `operator`, except under `by any`, where it means every
    source. `where_fitted` is as for a clause (`ir/skills.py`); a `permit` has none.
    """

    kind: Literal["permit", "forbid", "confirm", "degrade"]
    skills: tuple[Name, ...]
    roles: tuple[Name, ...]
    through: tuple[Name, ...]
    when: Condition | None
    approver: Name | None  # confirm: `by role supervisor`
    another: Name | None  # confirm: `and another of role supervisor`, who is another person
    within: Quantity | None  # confirm: `within 30 s`
    target: LinkDecl | None  # degrade: `to return_home`
    #: the `use` and `delegate` statements that produced an elaborated rule, the outermost first; empty for a
    #: written rule
    origin: tuple[Node, ...] = ()
    where_fitted: bool = False


class Delegation(Node):
    """`delegate goto, hover by role operator to role trainee through agent when altitude <= 10 m`.

    Everything that the policy permits to `grantor` of these skills (empty: any), it permits to `grantee` too,
    under the further condition and through no other source. Authority therefore only narrows.
    """

    skills: tuple[Name, ...]
    grantor: Name
    grantee: Name
    through: tuple[Name, ...]
    when: Condition | None


class Use(Node):
    """`use low_flight(bridge_a, top = 30 m)`: the rules of a template with these arguments."""

    template: Name
    arguments: tuple[ArgumentValue, ...]


class TemplateDecl(Node):
    """`template low_flight(area: zone, top: altitude) { permit ... }`: rules with parameters, for policies to use."""

    name: Name
    parameters: tuple[ParameterDecl, ...]
    rules: tuple[RuleDecl, ...]


class AirspaceDecl(Node):
    """`airspace inside city outside school, hospital`: the places where the vehicle may be."""

    inside: tuple[Name, ...]
    outside: tuple[Name, ...]


class Silence(Node):
    """`without link for 30 s contingency`: what follows a silence of the vehicle longer than `limit`."""

    limit: Quantity
    then: Literal["contingency", "continue"]


class PolicyDecl(Node):
    """`policy name version 7 { ... }`. `contingency` flies when a step is denied in the air, `without_evidence` says
    what a flight does while its records cannot be stored, and `without_link` what follows a long silence of the
    vehicle: None means `SILENCE_US` in `model/flat/policy.py`, then the contingency.
    """

    name: Name
    version: int
    rules: tuple[RuleDecl, ...]
    airspace: AirspaceDecl | None
    contingency: tuple[LinkDecl, ...]
    uses: tuple[Use, ...] = ()
    delegations: tuple[Delegation, ...] = ()
    without_evidence: Literal["land", "refuse"] = "land"
    without_link: Silence | None = None
