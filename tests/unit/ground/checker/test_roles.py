"""Roles are declared once per file, by any number of files, in a name space of their own."""

import pytest

from reference.sources import IMPORTS, found, policy

TEMPLATE = "template asked(low: altitude, who: role) { confirm hover by role who within 30 s }\n"


def told(*parts: str) -> list[tuple[str, str]]:
    """The code and the name of each finding on roles."""
    said = found(IMPORTS + "".join(parts))
    return [(code, text.split("`")[1]) for code, text in said if code in ("E0208", "E0202", "E0203")]


@pytest.mark.parametrize(
    "rule",
    [
        "permit hover by role operator, ranger",
        "forbid hover by role ranger through agent",
        "confirm hover by role ranger within 30 s",
        "confirm hover by role operator and another of role ranger within 30 s",
        "delegate hover by role operator to role ranger",
        "delegate hover by role ranger to role operator",
    ],
)
def test_role_of_a_rule_must_be_declared(rule: str) -> None:
    assert told(policy(rule)) == [("E0208", "ranger")]
    assert told("role ranger\n", policy(rule)) == []
    assert told(policy(rule), "role mate, ranger\n") == [], "wherever it stands"
    assert told("role Ranger\n", policy(rule)) == [("E0208", "ranger")]


def test_template_may_name_its_role_parameters() -> None:
    assert told(TEMPLATE, policy("use asked(9 m, ranger)")) == [("E0208", "ranger")]
    assert told(TEMPLATE, policy("use asked(who = ranger, low = 9 m)")) == [("E0208", "ranger")]
    assert told("role ranger\n", TEMPLATE, policy("use asked(9 m, ranger)", "use asked(9 m, operator)")) == []
    assert told(TEMPLATE, policy("use asked(9 m, operator, ranger)", "use nothing(ranger)")) == []
    assert told(TEMPLATE.replace("by role who", "by role ranger"), policy()) == [("E0208", "ranger")]
    assert told(TEMPLATE.replace("who: role", "who: altitude"), policy()) == [("E0208", "who")]


def test_role_declared_twice_in_a_file_is_reported() -> None:
    assert told("role ranger, mate\nrole mate\n", policy()) == [("E0202", "mate")]
    assert told("role mate, mate\n", policy()) == [("E0202", "mate")]
    assert told("role operator\n", policy()) == [], "it may be said"


def test_role_may_have_the_name_of_a_skill() -> None:
    assert told("role hover, rules, who, role\n", TEMPLATE, policy("forbid hover by role hover, role")) == []
