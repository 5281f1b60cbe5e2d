"""Descriptions of every construct of the language: checked by hand, complete, and without omissions."""

from collections.abc import Callable, Iterator
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, get_args, get_type_hints

import rtshcua.model.ir as ir
from rtshcua.diagnostics.span import Source
from rtshcua.ground.checker import time_zones
from rtshcua.ground.checker.substitution import sized
from rtshcua.ground.language.load import Program
from rtshcua.ground.language.parse import parse
from rtshcua.ground.report.policy_report import describe_test
from rtshcua.ground.report.prose.cases_and_scenarios import describe_nominal, describe_scenario
from rtshcua.ground.report.prose.condition_phrases import describe_condition
from rtshcua.ground.report.prose.phrases import Vocabulary
from rtshcua.ground.report.prose.rules_and_skills import (
    describe_accepted,
    describe_airspace,
    describe_chain,
    describe_clause,
    describe_delegation,
    describe_emitted,
    describe_evidence,
    describe_members,
    describe_motion,
    describe_parameter,
    describe_pictures,
    describe_record,
    describe_rule,
    describe_silence,
    describe_sources,
    describe_timing,
    describe_type,
    describe_unknown,
)
from rtshcua.ground.report.prose.zones_and_vehicle import (
    describe_band,
    describe_shape,
    describe_times,
    describe_vehicle,
    places_of,
)
from rtshcua.ground.report.reported_policy import within
from rtshcua.model.ir.expression import Condition
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.policies import PolicyDecl, RuleDecl
from rtshcua.model.ir.skills import SkillDecl
from virtual.rows import rows

NAMES = Vocabulary(
    frozenset(
        {"battery", "gps.fix", "wind.speed", "height", "position", "landed", "link.quality", "obstacle.distance"}
    ),
    frozenset({"bridge_a", "school"}),
    frozenset({"altitude", "target", "area", "speed"}),
    frozenset({"target"}),
)


def condition(text: str) -> Condition:
    parsed = parse(Source("x.rts", f"policy p version 1 {{ permit a by any when {text}\n}}"))
    assert parsed.diagnostics == ()
    (rule,) = parsed.unit.policies[0].rules
    assert rule.when is not None
    return rule.when


@rows(
    ("text", "words"),
    [
        ("battery > 35 %", "`battery` is above 35 %"),
        ("35 % <= battery", "35 % is at most `battery`"),
        ("altitude <= 40 m", "the `altitude` asked for is at most 40 m"),
        ("height < 120 m above sea", "`height` is below 120 m above sea level"),
        ("gps.fix >= fix_3d", "`gps.fix` is at least `fix_3d`"),
        ("landed == on_ground", "`landed` is `on_ground`"),
        ("not landed == in_air", "it is not so that `landed` is `in_air`"),
        ("landed != in_air", "`landed` is not `in_air`"),
        ("gps.fix in {fix_3d, dgps}", "`gps.fix` is `fix_3d` or `dgps`"),
        ("wind.speed in 0 m/s .. 8 m/s", "`wind.speed` is from 0 m/s up to 8 m/s"),
        ("local time in 08:00 .. 18:00", "the local time is between 08:00 and 18:00"),
        ("local time in 22:00 .. 06:00", "the local time is between 22:00 and 06:00, over midnight"),
        ("local time < 19:00", "the local time is before 19:00"),
        (
            "local time in 08:00 .. 18:00 on monday .. friday",
            "the local time is between 08:00 and 18:00 on Monday to Friday",
        ),
        (
            "local time in 22:00 .. 06:00 on friday",
            "the local time is between 22:00 and 06:00, over midnight, beginning on Friday",
        ),
        ("local time on friday .. monday", "the local time is on Monday and Friday to Sunday"),
        ("local time on sunday, saturday", "the local time is on Saturday and Sunday"),
        ("local time on monday .. wednesday, friday", "the local time is on Monday to Wednesday and Friday"),
        ("phase == inspection", "the phase of the mission is `inspection`"),
        (
            "target inside bridge_a",
            "the `target` asked for is inside `bridge_a` (on the ground, at whatever height)",
        ),
        ("position outside school", "`position` is outside `school`"),
        (
            "position inside grow(area, 15 m)",
            "`position` is inside the `area` asked for widened by 15 m",
        ),
        ("area inside grow(bridge_a, -5 m)", "the `area` asked for is inside `bridge_a` narrowed by 5 m"),
        (
            "obstacle.distance > 3 m + speed * 2 s",
            "`obstacle.distance` is above 3 m plus (the `speed` asked for times 2 s)",
        ),
        ("abs(height - 20 m) < 2 m", "the magnitude of (`height` minus 20 m) is below 2 m"),
        (
            "max(wind.speed, 3 m/s) <= 8 m/s",
            "the greatest of `wind.speed` and 3 m/s is at most 8 m/s",
        ),
        (
            "battery > 35 % and (area inside bridge_a or altitude < 9 m)",
            "`battery` is above 35 % and (the `area` asked for is inside `bridge_a` or the `altitude` asked for "
            "is below 9 m)",
        ),
        ("wind.speed < 8 m/s for the last 3 s", "`wind.speed` is below 8 m/s, all through the last 3 s"),
        (
            "(link.quality < 20 % or battery < 30 %) within the last 10 s",
            "(`link.quality` is below 20 % or `battery` is below 30 %), at some moment of the last 10 s",
        ),
        ("rising landed == in_air", "it has just become true that `landed` is `in_air`"),
        ("falling landed == in_air", "it has just become false that `landed` is `in_air`"),
        (
            "obstacle.distance < 5 m within 2 s of wind.speed > 9 m/s",
            "one of these holds now and the other did within the last 2 s: `obstacle.distance` is below 5 m; "
            "`wind.speed` is above 9 m/s",
        ),
    ],
)
def test_condition_is_described(text: str, words: str) -> None:
    assert describe_condition(condition(text), NAMES) == words


def test_interval_of_a_signal_is_described() -> None:
    text = "signal room : ratio = RADIO_STATUS.txbuf {}stale after 3 s"
    found = [parse(Source("x.rts", text.format(every))).unit.signals[0] for every in ("every 100 ms ", "")]
    source = "`RADIO_STATUS` field `txbuf`"
    assert [describe_sources(each) for each in found] == [f"{source}; its sender reports it every 100 ms", source]


def test_sample_has_every_node_of_the_language(everything_program: Program) -> None:
    for module in iter_modules(ir.__path__):
        import_module(f"rtshcua.model.ir.{module.name}")
    seen = {type(node) for unit in everything_program.units for node in within(unit)}
    assert not {kind.__name__ for kind in subclasses(Node)} - {kind.__name__ for kind in seen}


def subclasses(kind: type) -> Iterator[type]:
    for each in kind.__subclasses__():
        yield each
        yield from subclasses(each)


def tellers(unit: Any, names: Vocabulary) -> Iterator[tuple[Node, Callable[[Any], object]]]:
    """Each declaration of a file with its description."""
    for signal in unit.signals:
        yield signal, lambda one: (one.name.text, describe_type(one), describe_sources(one), describe_unknown(one))
    for enum in unit.enums:
        yield enum, lambda one: (one.name.text, describe_members(one))
    for vehicle in unit.vehicles:
        yield vehicle, lambda one: tuple(describe_vehicle(one))
    for zone in unit.zones:
        yield zone, tell_zone
    for skill in unit.skills:
        own = names.asked(each.name.text for each in skill.parameters)
        yield skill, lambda one, own=own: tell_skill(sized(one, None), own)
    for policy in unit.policies:
        yield policy, lambda one: tell_policy(one, names.asked(["altitude", "target", "area"]))
    for nominal in unit.nominals:
        yield nominal, lambda one: (one.name.text, *describe_nominal(one, names))
    for test in unit.tests:
        yield test, lambda one: tuple(describe_test(one, "" if one.nominal is None else one.nominal.text, names))
    for scenario in unit.scenarios:
        yield scenario, lambda one: (one.name.text, *describe_scenario(one, names))


def tell_zone(zone: ZoneDecl) -> object:
    places = tuple((what, at.latitude, at.longitude) for what, at in places_of(zone.shape))
    entry = None if zone.entry is None else (zone.entry.latitude, zone.entry.longitude)
    return zone.name.text, describe_shape(zone.shape), places, describe_band(zone), describe_times(zone), entry


def tell_skill(skill: SkillDecl, names: Vocabulary) -> object:
    return (
        skill.name.text,
        describe_motion(skill.motion) + describe_pictures(skill.pictures),
        [(each.name.text, describe_parameter(each, names)) for each in skill.parameters],
        list(describe_timing(skill)),
        [[describe_clause(each, names) for each in some] for some in (skill.require, skill.assume, skill.maintain)],
        describe_chain(skill.fallback, names),
        describe_record(skill),
        list(describe_accepted(skill)),
        list(describe_emitted(skill)),
    )


def tell_policy(policy: PolicyDecl, names: Vocabulary) -> object:
    uses = [policy.rules[0].copied(origin=(use,)) for use in policy.uses]
    return (
        policy.name.text,
        policy.version,
        [describe_rule(rule, names) for rule in (*policy.rules, *uses)],
        [describe_delegation(each, names) for each in policy.delegations],
        describe_airspace(policy.airspace),
        describe_chain(policy.contingency, names),
        describe_evidence(policy.without_evidence),
        None
        if policy.without_link is None
        else describe_silence(policy.without_link.limit.value, policy.without_link.then),
    )


def changed(node: Any) -> Iterator[tuple[str, Any]]:
    """A node with one changed leaf, for each leaf, and the name of the leaf."""
    for name, annotation in get_type_hints(type(node)).items():
        if (
            name not in type(node).__struct_fields__
            or name == "span"
            or (name == "kind" and not isinstance(node, RuleDecl))
        ):
            continue
        for where, other in others(getattr(node, name), annotation):
            yield f"{type(node).__name__}.{name}{where}", node.copied(**{name: other})


def others(value: Any, annotation: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Node):
        yield from ((f" > {where}", other) for where, other in changed(value))
    elif isinstance(value, bool):
        yield "", not value
    elif isinstance(value, int):
        yield "", value + 60_000_000
    elif isinstance(value, str):
        written = [each for part in (annotation, *get_args(annotation)) for each in get_args(part)]
        choices = [each for each in written if isinstance(each, str) and each != value]
        yield "", choices[0] if choices else value + "x"
    elif type(value) is tuple:
        for number, part in enumerate(value):
            for where, other in others(part, annotation):
                yield f"[{number}]{where}", (*value[:number], other, *value[number + 1 :])


def test_every_change_of_a_declaration_changes_its_description(everything_program: Program) -> None:
    """So nothing that is signed is left unsaid. The `dialect` of an enumeration only the checker reads, and that a
    choice is of the type `choice` is no word of the source. Of a size its value is told where it stands; what else it
    might be is not signed.
    """
    names = Vocabulary(
        frozenset(signal.name.text for unit in everything_program.units for signal in unit.signals),
        frozenset(zone.name.text for unit in everything_program.units for zone in unit.zones),
    )
    tried, silent = 0, []
    for unit in everything_program.units:
        for node, tell in tellers(unit, names):
            before = tell(node)
            for where, other in changed(node):
                unsigned = where.startswith("SkillDecl.sizes[") and (
                    "ParameterDecl.range" in where or "ParameterDecl.type" in where
                )
                if (
                    unsigned
                    or where.startswith("EnumDecl.dialect")
                    or where.endswith("[2] > ParameterDecl.type > Name.text")
                ):
                    continue
                tried += 1
                if tell(other) == before:
                    silent.append(where)
    assert not silent
    assert tried > 300


@rows(
    ("active", "words"),
    [
        ("active 08:00 .. 18:00 on monday", "from 08:00 to 18:00 local time on Monday"),
        ("active 22:00 .. 06:00 on friday", "from 22:00 to 06:00 local time, over midnight, beginning on Friday"),
        ("active on saturday, sunday", "on Saturday and Sunday, local time"),
    ],
)
def test_zone_with_days_of_the_week_is_described(active: str, words: str) -> None:
    parsed = parse(Source("x.rts", f"zone z = circle(47.1 N, 8.1 E, 9 m) {active}"))
    assert parsed.diagnostics == ()
    assert describe_times(parsed.unit.zones[0]) == words


def test_clock_with_a_time_zone_is_described() -> None:
    text = (
        'vehicle v { identity "v" home 47.1 N, 8.1 E within 1 m speed at most 1 m/s climb at most 1 m/s '
        'position error 1 m energy 100 % = 9 min hover reserve 9 % clock "Asia/Kolkata" }'
    )
    parsed = parse(Source("x.rts", text))
    assert parsed.diagnostics == ()
    told = dict(describe_vehicle(parsed.unit.vehicles[0]))
    assert told["Local time"] == f"that of Asia/Kolkata, by the time-zone data {time_zones.VERSION}"
