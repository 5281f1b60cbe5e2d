"""Assumption 3: bounded fallback. Each chain that compiles is finite, ends, and needs nothing at its end.

Statement. A program compiles only if each fallback chain of a skill, the contingency, and each target of a degrade rule
is bounded: it has at least one link and at most eight, none of them the skill itself; each link before the last, and
each target, has a time limit, a longest duration or a motion that ends; and the last link lands on the spot, without
`require`, `assume` or a limit. A flight under such chains ends, whatever fails.

Attacker: an author who writes any chain, and the environment of theorem 2, which strikes while it is flown.

Enforced by: `rtshcua/ground/checker/chains.py`, `rtshcua/onboard/runtime/fallback_flight.py`,
`rtshcua/onboard/enforcement/executor.py`, `rtshcua/decision/fallbacks.py`.

Not covered: the boundary does not check again that a chain is bounded: who holds the policy key can sign a bundle that
our compiler refuses. A vehicle that ignores all commands ends no link.

Programs are compared with a reading of what was drawn, which uses nothing of the checker. Flights are judged as in
theorem 2.
"""

from collections.abc import Callable
from random import Random
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from msgspec.structs import replace

from reference import flat_case as flat
from reference import worlds
from reference.flat_case import GOTO, HOME, HOVER, LAND, MISSION, POLICY, M, S
from reference.sources import findings, policy, program, skill
from reference.world import loaded
from rtshcua.diagnostics import codes
from rtshcua.ground.checker import chains
from rtshcua.ground.checker.checks import contracts
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.policy import Policy
from theorems.test_theorem_2_fallback import broken, flown

#: the findings about chains; a limit above a duration is one of the findings about times
OF_CHAINS = {
    codes.CHAIN_CYCLE, codes.ENDLESS_LINK, codes.NEEDY_LAST_LINK, codes.COVERING_LINK, codes.TOO_MANY,
    codes.INCOHERENT_TIMING,
}  # fmt: skip
MOST = 8


class Drawn(NamedTuple):
    """A skill of a program: its motion, the seconds that it lasts at most (0: not said), and its conditions."""

    name: str
    motion: str
    lasts: int
    require: str
    assume: str


class Called(NamedTuple):
    """A link: a skill, and its limit in seconds (0: none)."""

    skill: Drawn
    limit: int

    @property
    def text(self) -> str:
        return f"{self.skill.name}()" + (f" for {self.limit} s" if self.limit else "")


DOWN = Drawn("down", "land", 60, "", "")
#: skills of every program, so that each defect can be drawn
STAYS, SITS, BACK = (
    Drawn("stays", "hold", 0, "", ""),
    Drawn("sits", "hold", 30, "", ""),
    Drawn("back", "home", 0, "", ""),
)
NEEDY, ASSUMING = (
    Drawn("needy", "land", 0, "gps.fix >= fix_3d", ""),
    Drawn("assuming", "land", 0, "", "wind.speed < 12 m/s"),
)
SHIPPED = (STAYS, SITS, BACK, NEEDY, ASSUMING)
HOLDS = ("hold",) * 4
NEEDS = ("", "", "gps.fix >= fix_3d")


def drawn_skills(of: Random) -> list[Drawn]:
    return [
        Drawn(
            name, of.choice((*HOLDS, "home", "land", "land")), of.choice((0, 0, 30, 60)), of.choice(NEEDS),
            of.choice(("", "", "wind.speed < 12 m/s")),
        )
        for name in ("one", "two", "three", "four")
    ]  # fmt: skip


def drawn_chain(of: Random, skills: list[Drawn]) -> list[Called]:
    """Mostly a bounded chain."""
    chain = []
    for _ in range(of.choice((0, 1, 1, 2, 2, 3, 3, MOST - 1)) + (of.random() < 0.05)):
        called = of.choice(skills if of.random() < 0.05 else skills[1:])
        limits = (0, 5) if called.lasts or called.motion != "hold" else (5, 20)
        chain.append(Called(called, of.choice(limits if of.random() < 0.9 else (0, 0, 45))))
    last = DOWN if of.random() < 0.85 else of.choice(skills)
    return [*chain, Called(last, 9 if of.random() < 0.05 else 0)]


def bounded_chain(of: Random, skills: list[Drawn]) -> list[Called]:
    """A bounded chain that has room for a link more."""
    links_of = [Called(each, of.choice((5, 20))) for each in of.choices(skills[1:], k=of.randrange(MOST - 1))]
    return [*links_of, Called(DOWN, 0)]


def inserted(of: Random, chain: list[Called], link: Called) -> list[Called]:
    at = of.randrange(len(chain))
    return [*chain[:at], link, *chain[at:]]


def ended_by(chain: list[Called], last: Drawn, limit: int = 0) -> list[Called]:
    return [*chain[:-1], Called(last, limit)]


#: by defect: a chain that is bounded but for it, of a chain and the skill that has it
DEFECTS: dict[str, Callable[[Random, list[Called], Drawn], list[Called]]] = {
    "a link without an end": lambda of, chain, _: inserted(of, chain, Called(STAYS, 0)),
    "a limit above the duration": lambda of, chain, _: inserted(of, chain, Called(SITS, 45)),
    "a last link that holds": lambda _, chain, __: ended_by(chain, STAYS),
    "a last link that holds for a while": lambda _, chain, __: ended_by(chain, SITS),
    "a last link that flies home": lambda _, chain, __: ended_by(chain, BACK),
    "a last link that requires something": lambda _, chain, __: ended_by(chain, NEEDY),
    "a last link that assumes something": lambda _, chain, __: ended_by(chain, ASSUMING),
    "a last link with a limit": lambda _, chain, __: ended_by(chain, DOWN, 9),
    "too many links": lambda _, chain, __: [Called(BACK, 0)] * (MOST + 1 - len(chain)) + chain,
    "the skill itself": lambda of, chain, owner: inserted(of, chain, Called(owner, 5)),
    "the skill itself as the last link": lambda _, chain, owner: ended_by(chain, owner),
}
#: a chain of the policy has no skill of its own
OWN = ("the skill itself", "the skill itself as the last link")


def ends(call: Called) -> bool:
    return bool(call.limit or call.skill.lasts or call.skill.motion != "hold")


def coherent(call: Called) -> bool:
    return not (call.limit and call.skill.lasts) or call.limit <= call.skill.lasts


def bounded(chain: list[Called], owner: str = "") -> bool:
    """Whether a chain is bounded, by the statement."""
    last = chain[-1].skill
    lands = last.motion == "land" and not last.require and not last.assume and not chain[-1].limit
    inside = all(map(ends, chain[:-1])) and all(map(coherent, chain))
    return inside and lands and len(chain) <= MOST and owner not in {each.skill.name for each in chain}


def source(skills: list[Drawn], chain: list[Called], contingency: list[Called], target: Called) -> str:
    """A program in which `one` has a chain, and the policy a contingency and a degrade rule."""
    parts = [
        skill(
            f"{each.name}()", motion=each.motion, lasts=f"at most {each.lasts} s" if each.lasts else "",
            require=each.require, assume=each.assume,
            fallback=", ".join(link.text for link in chain) if each.name == "one" else "emergency_land",
        )
        for each in (*skills, *SHIPPED)
    ]  # fmt: skip
    down = skill("down()", motion="land", lasts="at most 60 s", fallback="")
    rule = f"degrade takeoff when battery < 30 % to {target.text}"
    return program(*parts, down, policy(rule, contingency=", ".join(link.text for link in contingency)))


def disagreement(of: Random) -> str:
    """What the compiler accepts although it is not bounded, or refuses although it is; empty if nothing."""
    skills = drawn_skills(of)
    chain, contingency = drawn_chain(of, skills), drawn_chain(of, skills)
    if of.random() < 0.6:
        contingency = [Called(DOWN, 0)]
    target = Called(of.choice(skills), of.choice((0, 20)))
    return compared(skills, chain, contingency, target)


def compared(skills: list[Drawn], chain: list[Called], contingency: list[Called], target: Called) -> str:
    """What the compiler says otherwise than the statement of a program; empty if nothing."""
    meant = bounded(chain, "one") and bounded(contingency) and ends(target) and coherent(target)
    text = source(skills, chain, contingency, target)
    refused = [f"{each.code.id} {each.message}" for each in findings(text) if each.code in OF_CHAINS]
    if meant and refused:
        return f"a bounded chain is refused: {refused}\n{text}"
    return "" if meant or refused else f"an unbounded chain compiles\n{text}"


@pytest.mark.claim("A3")
@given(worlds.CHANCES)
def test_exactly_bounded_chains_compile(of: Random) -> None:
    for _ in range(2):
        assert disagreement(of) == ""


@pytest.mark.soak
@pytest.mark.claim("A3")
@settings(max_examples=5_000)
@given(worlds.CHANCES)
def test_exactly_bounded_chains_compile_in_many_programs(of: Random) -> None:
    for _ in range(10):
        assert disagreement(of) == ""


def with_defect(of: Random, defect: str) -> str:
    """What `compared` finds in a program with one defect: in the chain of a skill, the contingency, or a target."""
    owner = DOWN._replace(name="one")
    skills = [owner, *drawn_skills(of)[1:]]
    chain, contingency = bounded_chain(of, skills), bounded_chain(of, skills)
    if defect in OWN or of.random() < 0.5:
        chain = DEFECTS[defect](of, chain, owner)
    else:
        contingency = DEFECTS[defect](of, contingency, owner)
    assert not (bounded(chain, "one") and bounded(contingency)), "the defect is none"
    return compared(skills, chain, contingency, Called(BACK, 0))


@pytest.mark.claim("A3")
@settings(max_examples=settings().max_examples // 3)
@given(of=worlds.CHANCES)
@pytest.mark.parametrize("defect", DEFECTS)
def test_chain_with_single_defect_does_not_compile(of: Random, defect: str) -> None:
    assert with_defect(of, defect) == ""


def test_chain_without_defect_compiles() -> None:
    """Otherwise a program with a defect could be refused for something else."""
    for of in map(Random, range(5)):
        skills = [DOWN._replace(name="one"), *drawn_skills(of)[1:]]
        found = findings(source(skills, bounded_chain(of, skills), bounded_chain(of, skills), Called(BACK, 0)))
        assert not [each for each in found if each.code in OF_CHAINS]


def test_both_kinds_of_chains_are_drawn() -> None:
    """Otherwise there would be nothing to compare."""
    drawn = [drawn_chain(of, drawn_skills(of)) for of in map(Random, range(300))]
    found = [bounded(chain, "one") for chain in drawn]
    assert 40 < sum(found) < 260, sum(found)
    assert max(len(chain) for chain, good in zip(drawn, found, strict=True) if good) == MOST


# ---------------------------------------------------------------------------------------------------- in flight


def links(of: Random) -> tuple[Link, ...]:
    """A bounded chain in the flat form."""
    before = (
        flat.link(HOVER, limit_us=of.randrange(1, 20) * S),
        flat.link(HOME),
        flat.link(HOME, limit_us=of.randrange(1, 60) * S),
        flat.link(GOTO, of.randrange(-90, 90) * M, 0, 20 * M, limit_us=of.randrange(1, 40) * S),
    )
    return (*(of.choice(before) for _ in range(of.randrange(5))), flat.link(LAND))


def under(chains_of: list[tuple[Link, ...]], contingency: tuple[Link, ...], target: Link) -> Policy:
    """The policy with these chains of its skills, and this target of its degrade rule."""
    contracts = tuple(
        replace(each, fallback=chain if each.fallback else ())
        for each, chain in zip(POLICY.contracts, chains_of, strict=True)
    )
    rules = tuple(replace(each, target=target) if each.target else each for each in POLICY.rules)
    return replace(POLICY, contracts=contracts, contingency=contingency, rules=rules)


def drawn_policy(of: Random) -> Policy:
    target = of.choice((flat.link(HOME), flat.link(LAND), flat.link(HOVER, limit_us=5 * S)))
    return under([links(of) for _ in POLICY.contracts], links(of), target)


def flight(of: Random, made: Policy) -> list[str]:
    """The violations of theorem 2 in a flight under a policy."""
    steps = tuple(replace(each, contract=made.contracts[each.skill]) for each in MISSION.invocations)
    return broken(flown(of, template=loaded(made, replace(MISSION, invocations=steps))))


@pytest.mark.claim("A3")
@given(worlds.CHANCES)
def test_flight_under_any_bounded_chains_ends(of: Random) -> None:
    assert flight(of, drawn_policy(of)) == []


@pytest.mark.soak
@pytest.mark.claim("A3")
@settings(max_examples=3_000)
@given(worlds.CHANCES)
def test_many_flights_under_bounded_chains_end(of: Random) -> None:
    assert flight(of, drawn_policy(of)) == []


# --------------------------------------------------------------------------------------------- what is detected


def found_by(*defects: str) -> bool:
    """Whether the search finds each of these defects in some program."""
    return all(
        any("an unbounded chain compiles" in with_defect(Random(seed), each) for seed in range(9)) for each in defects
    )


@pytest.mark.claim("A3", broken="a checker that accepts links without an end")
def test_search_detects_checker_without_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chains, "check_end", lambda *_: None)
    assert found_by("a link without an end")


@pytest.mark.claim("A3", broken="a checker that accepts any last link")
def test_search_detects_checker_without_last_link(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chains, "_last", lambda *_: None)
    assert found_by(*(each for each in DEFECTS if each.startswith("a last link")))


@pytest.mark.claim("A3", broken="a checker that accepts a skill in its own chain")
def test_search_detects_checker_without_owner(monkeypatch: pytest.MonkeyPatch) -> None:
    check = chains.check_chain
    monkeypatch.setattr(contracts, "check_chain", lambda context, links, _, span: check(context, links, None, span))
    assert found_by("the skill itself")


@pytest.mark.claim("A3", broken="chains that end in a hold without a limit")
def test_search_detects_chain_without_end() -> None:
    endless = (flat.link(HOVER),)
    made = under([endless for _ in POLICY.contracts], endless, flat.link(HOVER))
    assert any("it did not end" in flight(Random(seed), made) for seed in range(60))
