"""The first page of a policy: what a person signs on to, from what its chapter says."""

from collections.abc import Iterable, Iterator

from rtshcua.ground.report.prose.phrases import listed, name
from rtshcua.ground.report.report_model import Chapter, Fact, Glance, Rights

#: so many things are told one by one; of more how many there are
MANY = 6
#: what no policy decides, whatever it says
BEYOND = (
    "A pilot who takes the controls, and what the autopilot does by itself (its failsafes): the policy does not hold "
    "them back.",
    "Whether the vehicle is airworthy, and whether the flight is allowed by law. What the policy does not read, it "
    "does not know of: people, other aircraft and obstacles too, where no signal reports them.",
)


def glance(chapter: Chapter) -> Glance:
    """A chapter on one page."""
    return Glance(
        who=tuple(_who(chapter.rights)),
        where=tuple(_where(chapter)),
        height=tuple(_height(chapter)),
        speed=tuple(_speed(chapter)),
        person=tuple(_person(chapter)),
        wrong=tuple(_wrong(chapter)),
        beyond=tuple(_beyond(chapter)),
    )


def _some(texts: Iterable[str], rest: str) -> Iterator[str]:
    """The first of these, and how many more there are."""
    every = list(texts)
    yield from every[:MANY]
    if len(every) > MANY:
        yield f"{len(every) - MANY} more: {rest}"


def _who(rights: Iterable[Rights]) -> Iterator[Fact]:
    """For each role what it may have done, by the answer; nothing is told of what it may not."""
    for each in rights:
        answers: dict[str, list[str]] = {}
        for right in each.rights:
            if right.answer != "no":
                answers.setdefault(right.answer, []).append(name(right.skill))
        told = "; ".join(f"{answer}: {listed(skills)}" for answer, skills in answers.items())
        yield Fact(f"role {name(each.role)}" if each.role else "everybody else", told or "nothing")


def _where(chapter: Chapter) -> Iterator[str]:
    yield chapter.airspace
    zones = [zone for zone in chapter.zones if zone.use]
    yield from _some(
        (f"{'inside' if zone.use == 'allowed' else 'outside'} {name(zone.name)}: {zone.shape}"
         + (f"; {zone.times}" if zone.times else "") for zone in zones),
        "see airspace and zones",
    )  # fmt: skip
    yield from _permitted(chapter, "place")


def _height(chapter: Chapter) -> Iterator[str]:
    bands = [f"{name(zone.name)}: {zone.band}" for zone in chapter.zones if zone.use == "allowed"]
    yield from _some(bands, "see airspace and zones")
    limits = _permitted(chapter, "altitude")
    yield from limits
    if not bands and not limits:
        yield "This policy sets no limit to the height."


def _speed(chapter: Chapter) -> Iterator[str]:
    yield from (f"The vehicle flies {fact.value}." for fact in chapter.vehicle if fact.what == "Speed")
    yield from _permitted(chapter, "speed")


def _permitted(chapter: Chapter, kind: str) -> list[str]:
    """What the rules permit at most, whoever asks; not what a skill could be asked for."""
    return [
        f"{name(each.skill)} is permitted with {name(each.parameter)} {each.limits}"
        + (", under conditions" if each.conditions else "")
        if kind != "place"
        else f"{name(each.skill)} is permitted {each.limits}" + ("; under conditions" if each.conditions else "")
        for each in chapter.permitted
        if each.kind == kind
    ]


def _person(chapter: Chapter) -> Iterator[str]:
    asked = [f"{rule.told} (rule {rule.number})" for rule in chapter.rules if rule.kind == "confirm"]
    yield from _some(asked, "see the rules")
    if not asked:
        yield "Nothing: no rule asks a person to approve a step."


def _wrong(chapter: Chapter) -> Iterator[Fact]:
    chain = " ".join(chapter.contingency)
    yield Fact("A step is denied in the air", chain or "The policy says nothing.")
    degrades = [rule.told for rule in chapter.rules if rule.kind == "degrade"]
    for told in _some(degrades, "see when something goes wrong"):
        yield Fact("Instead of what was asked", told)
    yield Fact("Records cannot be kept", chapter.evidence)
    yield Fact("The vehicle is not heard", chapter.silence)


def _beyond(chapter: Chapter) -> Iterator[str]:
    signals = [name(signal.name) for signal in chapter.signals]
    yield f"Only this is known of the vehicle and around it: {listed(signals) or 'nothing'}."
    left_out = len(chapter.rules_left_out) + sum(len(skill.left_out) for skill in chapter.skills)
    if left_out:
        yield (
            f"{left_out} rule{'s' * (left_out > 1)} and clauses of the sources do not count, as the vehicle is without "
            "the sensor for them."
        )
    if not chapter.missions:
        yield "No mission is listed here: each is agreed to by itself."
    if not chapter.cases and not chapter.scenarios:
        yield "No test of this policy is among the sources."
    yield from BEYOND
