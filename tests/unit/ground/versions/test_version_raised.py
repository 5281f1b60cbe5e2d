"""The differences between two versions of a policy, their direction, and the finding on a version not raised."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.ground.versions.differences import compared as parted
from rtshcua.ground.versions.differences import differences
from rtshcua.ground.versions.direction import CANNOT_TELL, LOOSER, STRICTER, direction
from rtshcua.ground.versions.raised import VersionComparison, compare
from rtshcua.mavlink import dialect
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]

SKILLS = """
skill rise(top: altitude in 5 m .. 50 m = 10 m, pace: one of slow, quick = slow) {
  motion climb to top class tactical deadline 5 s valid for 40 min lasts at most 1 min
  require battery > 30 %
  fallback home, down energy at most 5 % record intent, decision, state, authorization, effect
}
skill look(area: zone, at: altitude in 5 m .. 50 m) {
  motion cover area at at class tactical deadline 5 s valid for 40 min during work lasts at most 5 min
  assume gps.fix >= fix_3d for the last 3 s
  maintain position inside grow(area, 30 m)
  fallback home, down energy at most 9 % record intent, decision, state, authorization, effect
}
skill home() {
  motion home class tactical deadline 5 s valid for 1 h lasts at most 3 min
  fallback down energy at most 9 % record intent, decision, state, authorization, effect
}
skill down() {
  motion land class tactical deadline 5 s valid for 1 h lasts at most 2 min
  energy at most 5 % record intent, decision, state, authorization, effect
}
"""
SITE = """
vehicle quad {
  identity "quad-07" home 47.39774 N, 8.54559 E within 20 m speed at most 12 m/s climb at most 3 m/s
  position error 3 m energy 100 % = 18 min hover reserve 15 % clock utc +00:00
}
zone field  = circle(47.39774 N, 8.54559 E, 400 m) ceiling 120 m above home
zone school = circle(47.39729 N, 8.54999 E, 40 m)
zone roof   = circle(47.39850 N, 8.54600 E, 40 m) ceiling 60 m
"""
POLICY = """
policy yard version 3 {
  permit rise by role operator, trainee through agent, operator when top <= 20 m and pace == slow
  permit look by role operator through agent when area inside field and at <= 30 m
  permit home, down by any
  forbid look by any when phase == landing or local time in 22:00 .. 06:00
  confirm look when at < 10 m by role chief within 30 s
  degrade any when battery < 25 % to home
  degrade any when position inside grow(school, 20 m) to down
  airspace inside field outside school
  contingency home, down
}
"""
TEXT = 'import "lib:skills/signals.rts"\nrole trainee, chief, boss\n' + SKILLS + SITE + POLICY


def load_text(text: str) -> Program:
    def read(path: str) -> bytes:
        return text.encode() if path == "yard.rts" else Path(path).read_bytes()

    return load(["yard.rts"], read, str(CHECKOUT))


def lowered(text: str) -> LoweredPolicy:
    checked = examine_program(load_text(text), dialect.load())
    assert not checked.diagnostics, checked.diagnostics
    (policy,) = checked.policies
    return policy


@pytest.fixture(scope="module")
def before() -> LoweredPolicy:
    return lowered(TEXT)


def changed(changes: Mapping[str, str]) -> str:
    text = TEXT
    for old, new in changes.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


@rows(
    ("old", "new"),
    [
        ("policy yard", "// a comment\npolicy   yard"),
        ("top <= 20 m and", "top <= 2000 cm and"),
        ("zone school", "zone aside = circle(47.39900 N, 8.54500 E, 5 m)\nzone school"),  # below: only the zone
        ("by role operator, trainee", "by role trainee, operator"),
        ("through agent, operator", "through operator, agent"),
        ("deadline 5 s valid for 40 min lasts", "valid for 2400 s  deadline 5000 ms lasts"),
        (
            "record intent, decision, state, authorization, effect\n}\nskill look",
            "record effect, state, intent, decision, authorization\n}\nskill look",
        ),
    ],
)
def test_change_without_a_new_meaning_is_not_a_difference(before: LoweredPolicy, old: str, new: str) -> None:
    words = differences(before.policy, lowered(changed({old: new})).policy)
    assert words == (("the new zone `aside`",) if "aside" in new else ())


def test_order_of_declarations_is_not_a_difference(before: LoweredPolicy) -> None:
    school, roof = (line for line in SITE.splitlines() if line.startswith(("zone school", "zone roof")))
    text = (
        TEXT.replace(school, "").replace(roof, f"{roof}\n{school}").replace(POLICY, "").replace(SKILLS, POLICY + SKILLS)
    )
    assert differences(before.policy, lowered(text).policy) == ()


def test_order_of_rules_is_a_difference_only_if_the_first_decides(before: LoweredPolicy) -> None:
    lines = POLICY.splitlines()
    lines[2:4] = lines[3], lines[2]
    assert differences(before.policy, lowered(TEXT.replace(POLICY, "\n".join(lines))).policy) == ()
    lines[7:9] = lines[8], lines[7]
    after = lowered(TEXT.replace(POLICY, "\n".join(lines))).policy
    assert differences(before.policy, after) == ("the order of its `degrade` rules",)


@rows(
    ("old", "new", "words"),
    [
        ("top <= 20 m", "top <= 21 m", "the rule `permit rise by role operator, trainee through agent, oper...`"),
        ("pace == slow", "pace == quick", "the rule `permit rise by role operator, trainee through agent, oper...`"),
        ("operator, trainee", "operator", "the rule `permit rise by role operator through agent, operator when...`"),
        ("permit home, down by any", "permit home, down by any permit look by role chief when at <= 9 m",
         "the new rule `permit look by role chief when at <= 9 m`"),
        ("degrade any when battery < 25 % to home\n", "",
         "the removed rule `degrade any when battery < 25 % to home`"),
        ("phase == landing", "phase == hover", "the rule `forbid look by any when phase == hover or"),
        ("22:00 .. 06:00", "21:00 .. 06:00", "the rule `forbid look by any when phase == landing or"),
        ("within 30 s", "within 31 s", "the rule `confirm look when at < 10 m by role chief within 31 s`"),
        ("role chief", "role boss", "the rule `confirm look when at < 10 m by role boss within 30 s`"),
        ("grow(school, 20 m) to", "grow(school, 21 m) to",
         "the rule `degrade any when position inside grow(school, 21 m) to down`"),
        ("inside field outside school", "inside field", "the airspace"),
        ("contingency home, down", "contingency home for 2 min, down", "the contingency"),
        ("contingency home, down", "contingency home, down without evidence refuse", "the action without evidence"),
        (
            "contingency home, down",
            "contingency home, down without link for 31 s contingency",
            "the action after a silence of the vehicle",
        ),
        (
            "contingency home, down",
            "contingency home, down without link for 30 s continue",
            "the action after a silence of the vehicle",
        ),
        ("reserve 15 %", "reserve 16 %", "the vehicle (reserve)"),
        ("position error 3 m energy 100 % = 18 min", "position error 4 m energy 100 % = 19 min",
         "the vehicle (position error, energy, speeds)"),
        ("47.39774 N, 8.54559 E within", "47.39775 N, 8.54559 E within", "the vehicle (home)"),
        ("E, 40 m) ceiling 60 m", "E, 41 m) ceiling 61 m", "the zone `roof` (shape, ceiling)"),
        ("ceiling 60 m\n", "ceiling 60 m active 08:00 .. 18:00\n", "the zone `roof` (active)"),
        ("ceiling 60 m\n", "ceiling 60 m active 08:00 .. 18:00 on monday\n", "the zone `roof` (active)"),
        ("clock utc +00:00", 'clock "Europe/Zurich"', "the vehicle (local time)"),
        ("local time in 22:00 .. 06:00", "local time in 22:00 .. 06:00 on friday", "the rule `forbid look"),
        ("require battery > 30 %", "require battery > 31 %", "the skill `rise` (require)"),
        ("for the last 3 s", "for the last 4 s", "the skill `look` (assume)"),
        ("grow(area, 30 m)", "grow(area, 31 m)", "the skill `look` (maintain)"),
        ("during work", "during landing", "the skill `look` (valid)"),
        ("fallback down energy", "grace 1 s fallback down energy", "the skill `home` (grace)"),
    ],
)  # fmt: skip
def test_difference_is_described(before: LoweredPolicy, old: str, new: str, words: str) -> None:
    (found,) = differences(before.policy, lowered(changed({old: new})).policy)
    assert found.startswith(words)


def test_newly_missing_sensor_is_listed_first_and_as_looser(before: LoweredPolicy) -> None:
    """A sensor that is present again is listed too."""
    fitted = changed({"require battery > 30 %": "require battery > 30 % assume wind.speed < 9 m/s where fitted"})
    old = lowered(fitted).policy
    new = lowered(
        fitted.replace("clock utc", "without wind.speed clock utc").replace("top <= 20 m", "top <= 21 m")
    ).policy
    assert new.vehicle.without == ("wind.speed",)
    assert [clause.text for clause in new.left_out] == ["wind.speed < 9 m/s"]
    first, *rest = differences(old, new)
    assert first.startswith("looser: the vehicle is now without the signal `wind.speed`")
    assert [told.partition(" `")[0] for told in rest] == ["the rule", "the skill", "the removed signal"]
    assert differences(new, old)[0] == "the vehicle is no longer without the signal `wind.speed`"


def test_zone_at_another_index_is_not_a_difference(before: LoweredPolicy) -> None:
    """Sets and tables have more members then, but the same ones for the old zones."""
    inside = "zone shed = circle(47.39780 N, 8.54500 E, 5 m)\nzone field"
    after = lowered(changed({"zone field": inside})).policy
    assert after.sets != before.policy.sets
    assert differences(before.policy, after) == ("the new zone `shed`",)
    assert differences(after, before.policy) == ("the removed zone `shed`",)


def compared(before: LoweredPolicy, text: str) -> VersionComparison:
    program = load_text(text)
    checked = examine_program(program, dialect.load())
    (found,) = compare(checked.policies, [before.policy], "old.bundle", program.sources)
    return found


def finding(before: LoweredPolicy, text: str) -> tuple[Diagnostic, str, str]:
    """The finding, the text under its span, and the source after its fix."""
    found = compared(before, text).finding
    assert found is not None
    assert found.code.id == "E0716"
    assert found.span is not None
    (fix,) = found.fixes
    return found, text[slice(*found.span[1:])], text[: fix.span.start] + fix.replacement + text[fix.span.end :]


def test_change_without_a_higher_version_is_found(before: LoweredPolicy) -> None:
    text = changed({"top <= 20 m": "top <= 21 m", "reserve 15 %": "reserve 16 %", "ceiling 60 m": "ceiling 61 m",
                    "battery > 30 %": "battery > 31 %"})  # fmt: skip
    found, underlined, fixed = finding(before, text)
    assert underlined == "3"
    assert found.message == "`yard` differs from the one in `old.bundle`, but both have version 3"
    assert found.help == (
        "raise it to version 4, here and in the missions under it; it differs in the rule `permit rise by role "
        "operator, trainee through agent, oper...`, the vehicle (reserve), the zone `roof` (ceiling), and 1 more"
    )
    assert compared(before, fixed).finding is None


def test_lower_version_is_found_with_and_without_a_change(before: LoweredPolicy) -> None:
    lower = changed({"version 3": "/* as\nversion 9 */ version // 8\n 2"})
    found, underlined, fixed = finding(before, lower)
    assert underlined == "2"
    assert found.message == "`yard` has version 2, but version 3 in `old.bundle`"
    assert found.help == "a version never goes back: write version 3"
    assert compared(before, fixed).finding is None
    found, _, fixed = finding(before, lower.replace("top <= 20 m", "top <= 21 m"))
    assert (found.help or "").startswith(
        "a version never goes back: write version 4; it differs in the rule `permit rise"
    )
    assert compared(before, fixed).finding is None


@pytest.mark.parametrize("change", [{}, {"version 3": "version 4"}, {"version 3": "version 9", "20 m and": "21 m and"}])
def test_raised_or_unchanged_version_is_accepted(before: LoweredPolicy, change: dict[str, str]) -> None:
    assert compared(before, changed(change)).finding is None


def test_policy_of_another_name_or_vehicle_is_not_compared(before: LoweredPolicy) -> None:
    for change in ({"policy yard": "policy field_trip"}, {"quad-07": "hexa-01", "vehicle quad": "vehicle hexa"}):
        program = load_text(changed(change | {"version 3": "version 1"}))
        checked = examine_program(program, dialect.load())
        assert checked.policies
        assert compare(checked.policies, [before.policy], "old", program.sources) == ()
    renamed, _, _ = finding(before, changed({"quad-07": "quad-08"}))
    assert "the vehicle (identity)" in (renamed.help or "")


def test_policy_is_compared_with_the_newest_earlier_one(before: LoweredPolicy) -> None:
    older, other = (
        lowered(changed({"version 3": "version 2"})).policy,
        lowered(changed({"reserve 15 %": "reserve 16 %"})).policy,
    )
    program = load_text(TEXT)
    policies = examine_program(program, dialect.load()).policies
    for earlier in ([older, before.policy], [before.policy, older], [other, before.policy], [before.policy, other]):
        (found,) = compare(policies, earlier, "old", program.sources)
        assert (found.earlier, found.finding) == (3, None)


def test_program_with_errors_has_no_policies_to_compare() -> None:
    assert examine_program(load_text(TEXT + "zone z = nowhere"), dialect.load()).policies == ()


# ------------------------------------------------------------------------------------------ stricter or looser


@pytest.mark.slow
@rows(
    ("old", "new", "way"),
    [
        # rules
        ("top <= 20 m and", "top <= 18 m and", STRICTER),
        ("top <= 20 m and", "top < 20 m and", STRICTER),
        ("top <= 20 m and", "", LOOSER),
        ("top <= 20 m and", "top <= 20 m and battery > 50 % and", STRICTER),
        ("top <= 20 m and", "top >= 6 m and", CANNOT_TELL),
        ("top <= 20 m and", "(top <= 20 m or battery > 50 %) and", LOOSER + "?"),
        (" when top <= 20 m and pace == slow", "", LOOSER),
        ("by role operator, trainee", "by role operator", STRICTER),
        ("role operator, trainee through agent, operator when top", "any when top", LOOSER),
        ("  permit home, down by any\n", "  permit home, down by any\n  permit look by role chief\n", LOOSER),
        ("phase == landing or local time in", "local time in", LOOSER + "?"),
        ("at < 10 m by role chief", "at < 15 m by role chief", STRICTER),
        ("at < 10 m by role chief", "at < 7 m by role chief", LOOSER),
        ("at < 10 m by role chief within", "at < 10 m by role chief and another of role boss within", STRICTER),
        ("by role chief within 30 s", "by role chief within 60 s", CANNOT_TELL),
        ("by role chief within", "by role boss within", CANNOT_TELL),
        ("  confirm look when at < 10 m by role chief within 30 s\n", "", LOOSER),
        ("degrade any when battery < 25 % to", "degrade any when battery < 30 % to", CANNOT_TELL),
        # where
        ("airspace inside field outside school", "airspace inside field outside school, roof", STRICTER),
        ("airspace inside field outside school", "airspace inside field", LOOSER),
        ("airspace inside field outside school", "airspace inside field, roof", CANNOT_TELL),
        ("circle(47.39850 N, 8.54600 E, 40 m) ceiling 60 m", "circle(47.39850 N, 8.54600 E, 45 m) ceiling 60 m",
         CANNOT_TELL),
        # skills
        ("top: altitude in 5 m .. 50 m", "top: altitude in 5 m .. 40 m", STRICTER),
        ("top: altitude in 5 m .. 50 m", "top: altitude in 3 m .. 60 m", LOOSER),
        ("top: altitude in 5 m .. 50 m", "top: altitude in 3 m .. 40 m", CANNOT_TELL),
        ("one of slow, quick", "one of slow, quick, wild", CANNOT_TELL),
        ("require battery > 30 %", "require battery > 35 %", STRICTER),
        ("require battery > 30 %", "require battery > 25 %", LOOSER),
        ("fallback home, down energy at most 5 %", "fallback home, down energy at most 6 %", CANNOT_TELL),
        ("fallback home, down energy at most 5 %", "fallback down energy at most 5 %", CANNOT_TELL),
        ("valid for 40 min lasts at most 1 min", "valid for 30 min lasts at most 1 min", STRICTER),
        ("valid for 40 min lasts at most 1 min", "valid for 30 min lasts at most 2 min", CANNOT_TELL),
        # the vehicle
        ("reserve 15 %", "reserve 20 %", STRICTER),
        ("reserve 15 %", "reserve 10 %", LOOSER),
        ("position error 3 m", "position error 4 m", CANNOT_TELL),
    ],
)  # fmt: skip
def test_direction_of_a_difference(before: LoweredPolicy, old: str, new: str, way: str) -> None:
    after = lowered(changed({old: new})).policy
    found = [direction(each, before.policy, after) for each in parted(before.policy, after)]
    if way.endswith("?"):  # intervals alone do not decide it, but the opposite would be wrong
        assert found in ([way[:-1]], [CANNOT_TELL])
        return
    assert found == [way]
    back = [direction(each, after, before.policy) for each in parted(after, before.policy)]
    assert back == [{STRICTER: LOOSER, LOOSER: STRICTER}.get(way, way)], "the other way round it is the opposite"


def test_direction_of_a_changed_zone_depends_on_its_use() -> None:
    """If no condition names the zone, only the airspace uses it."""
    text = TEXT.replace(" area inside field and", "").replace(
        "  degrade any when position inside grow(school, 20 m) to down\n", ""
    )
    old = lowered(text).policy

    def way(was: str, now: str) -> list[str]:
        assert text.count(was) == 1
        new = lowered(text.replace(was, now)).policy
        return [direction(each, old, new) for each in parted(old, new)]

    assert way("ceiling 120 m above home", "ceiling 100 m above home") == [STRICTER]
    assert way("ceiling 120 m above home", "ceiling 130 m above home") == [LOOSER]
    assert way("8.54559 E, 400 m)", "8.54559 E, 500 m)") == [LOOSER]
    assert way("8.54999 E, 40 m)", "8.54999 E, 50 m)") == [STRICTER], "what must not be entered"
    assert way("8.54999 E, 40 m)", "8.54998 E, 40 m)") == [CANNOT_TELL]
