"""Authority policies."""

from typing import Any

from rtshcua.diagnostics.codes import NOT_WRITTEN
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.base import Part
from rtshcua.ground.language.build.skills import Skills
from rtshcua.model.ir.expression import Condition, Quantity
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import Airspace, Delegation, PolicyDecl, RoleDecl, Rule, Silence, TemplateDecl, Use
from rtshcua.model.ir.skills import ArgumentValue, LinkDecl, Parameter

Names = tuple[Name, ...]


class Policies(Skills):
    """Who may have which skill done, where and when."""

    def anyone(self, span: Span) -> Names:
        """`any` skill, or `by any` role: no name in particular."""
        return ()

    def permit(self, span: Span, skills: Names, roles: Names, through: Names | None, when: Condition | None) -> Rule:
        """`permit takeoff by role operator through agent when altitude <= 40 m`."""
        return Rule(
            span=span, kind="permit", skills=skills, roles=roles, through=through or (), when=when,
            approver=None, another=None, within=None, target=None,
        )  # fmt: skip

    def forbid(
        self, span: Span, skills: Names, roles: Names, through: Names | None, when: Condition | None,
        fitted: bool | None,
    ) -> Rule:  # fmt: skip
        """`forbid track_target by any`."""
        return Rule(
            span=span, kind="forbid", skills=skills, roles=roles, through=through or (), when=when,
            approver=None, another=None, within=None, target=None, where_fitted=fitted is True,
        )  # fmt: skip

    def confirm(
        self, span: Span, skills: Names, when: Condition | None, approver: Name, another: Name | None,
        within: Quantity | None, fitted: bool | None,
    ) -> Rule:  # fmt: skip
        """`confirm inspect_area when altitude < 10 m by role supervisor and another of role safety within 30 s`."""
        return Rule(
            span=span, kind="confirm", skills=skills, roles=(), through=(), when=when,
            approver=approver, another=another, within=within, target=None, where_fitted=fitted is True,
        )  # fmt: skip

    def degrade(self, span: Span, skills: Names, when: Condition | None, target: LinkDecl, fitted: bool | None) -> Rule:
        """`degrade any when wind.speed > 6 m/s to return_home where fitted`."""
        return Rule(
            span=span, kind="degrade", skills=skills, roles=(), through=(), when=when,
            approver=None, another=None, within=None, target=target, where_fitted=fitted is True,
        )  # fmt: skip

    def airspace(self, span: Span, inside: Names | None, outside: Names | None) -> Part:
        """`airspace inside city outside school`."""
        if inside is None and outside is None:
            help = "write `inside`, `outside` or both, as in `airspace inside city outside school`"
            self.report(NOT_WRITTEN, "the airspace has no zone", span, help)
        return Part("airspace", span, Airspace(span=span, inside=inside or (), outside=outside or ()))

    def contingency(self, span: Span, links: tuple[LinkDecl, ...]) -> Part:
        """`contingency hover for 10 s, return_home, emergency_land`."""
        return Part("contingency", span, links)

    def without_evidence(self, span: Span, otherwise: Any) -> Part:
        """`without evidence refuse`."""
        return Part("without evidence", span, otherwise)

    def without_link(self, span: Span, limit: Quantity, then: Any) -> Part:
        """`without link for 30 s contingency`."""
        return Part("without link", span, Silence(span=span, limit=limit, then=then))

    def use(self, span: Span, template: Name, arguments: tuple[ArgumentValue, ...] | None) -> Use:
        """`use low_flight(bridge_a, top = 30 m)`."""
        return Use(span=span, template=template, arguments=arguments or ())

    def delegate(
        self, span: Span, skills: Names, grantor: Name, grantee: Name, through: Names | None, when: Condition | None
    ) -> Delegation:
        """`delegate goto by role operator to role trainee through agent when altitude <= 10 m`."""
        return Delegation(span=span, skills=skills, grantor=grantor, grantee=grantee, through=through or (), when=when)

    def role(self, span: Span, names: Names) -> None:
        """`role supervisor, trainee`."""
        self.declare(RoleDecl(span=span, names=names))

    def template(self, span: Span, name: Name, parameters: tuple[Parameter, ...] | None, *rules: Rule) -> None:
        """`template low_flight(area: zone, top: altitude) { permit ... }`."""
        self.undotted(name, "template")
        self.declare(TemplateDecl(span=span, name=name, parameters=parameters or (), rules=rules), name)

    def policy(self, span: Span, name: Name, version: int, *given: Rule | Use | Delegation | Part) -> None:
        """`policy bridge_inspection version 7 { ... }`."""
        self.undotted(name, "policy")
        found = self.parts("policy", name, [part for part in given if isinstance(part, Part)])
        self.declare(
            PolicyDecl(
                span=span,
                name=name,
                version=version,
                rules=tuple(rule for rule in given if isinstance(rule, Rule)),
                airspace=found["airspace"].value if "airspace" in found else None,
                contingency=found["contingency"].value if "contingency" in found else (),
                uses=tuple(use for use in given if isinstance(use, Use)),
                delegations=tuple(each for each in given if isinstance(each, Delegation)),
                without_evidence=found["without evidence"].value if "without evidence" in found else "land",
                without_link=found["without link"].value if "without link" in found else None,
            ),
            name,
        )
