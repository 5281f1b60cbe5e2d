"""The first page of a policy: a summary of its chapter for the person who signs it."""

from collections.abc import Iterable, Iterator

from rtshcua.ground.report.prose.phrases import listed, name
from rtshcua.ground.report.report_model import Chapter, Fact, Glance, Rights

#: the most items that are listed; of more only their number is given
MANY = 6
#: what no policy covers
BEYOND = (
    "A pilot who takes the controls, and the autopilot's own failsafes: the policy does not restrict them.",
    "Whether the vehicle is airworthy, and whether the flight is legal. The policy does not know of people, other "
    "aircraft and obstacles that no signal reports.",
)


def glance(chapter: Chapter) -> Glance:
    """Summarise a chapter on one page."""
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
    """Yield the first texts, and the number of further ones."""
    every = list(texts)
    yield from every[:MANY]
    if len(every) > MANY:
        yield f"{len(every) - MANY} more: {rest}"


def _who(rights: Iterable[Rights]) -> Iterator[Fact]:
    """Yield the permitted skills of each role, by answer."""
    for each in rights:
        answers: dict[str, list[str]] = {}
        for right in each.rights:
            if right.answer != "no":
                answers.setdefault(right.answer, []).append(name(right.skill))
        permitted = "; ".join(f"{answer}: {listed(skills)}" for answer, skills in answers.items())
        yield Fact(f"role {name(each.role)}" if each.role else "everybody else", permitted or "nothing")


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
        yield "This policy does not limit the height."


def _speed(chapter: Chapter) -> Iterator[str]:
    yield from (f"The vehicle flies {fact.value}." for fact in chapter.vehicle if fact.what == "Speed")
    yield from _permitted(chapter, "speed")


def _permitted(chapter: Chapter, kind: str) -> list[str]:
    """The widest limits that the rules permit to anyone."""
    return [
        f"{name(each.skill)} is permitted with {name(each.parameter)} {each.limits}"
        + (", under conditions" if each.conditions else "")
        if kind != "place"
        else f"{name(each.skill)} is permitted {each.limits}" + ("; under conditions" if each.conditions else "")
        for each in chapter.permitted
        if each.kind == kind
    ]


def _person(chapter: Chapter) -> Iterator[str]:
    confirmed = [f"{rule.told} (rule {rule.number})" for rule in chapter.rules if rule.kind == "confirm"]
    yield from _some(confirmed, "see the rules")
    if not confirmed:
        yield "Nothing: no rule requires a person to approve a step."


def _wrong(chapter: Chapter) -> Iterator[Fact]:
    chain = " ".join(chapter.contingency)
    yield Fact("A step is denied in the air", chain or "The policy does not say.")
    degrades = [rule.told for rule in chapter.rules if rule.kind == "degrade"]
    for text in _some(degrades, "see when something goes wrong"):
        yield Fact("Instead of the requested step", text)
    yield Fact("Records cannot be kept", chapter.evidence)
    yield Fact("The vehicle is silent", chapter.silence)


def _beyond(chapter: Chapter) -> Iterator[str]:
    signals = [name(signal.name) for signal in chapter.signals]
    yield f"The policy reads only these signals of the vehicle and its surroundings: {listed(signals) or 'none'}."
    left_out = len(chapter.rules_left_out) + sum(len(skill.left_out) for skill in chapter.skills)
    if left_out:
        yield (
            f"{left_out} rule{'s' * (left_out > 1)} and clauses of the sources do not apply, because the vehicle does "
            "not have the sensor for them."
        )
    if not chapter.missions:
        yield "No mission is listed here: each mission needs its own approval."
    if not chapter.cases and not chapter.scenarios:
        yield "The sources have no test of this policy."
    yield from BEYOND
