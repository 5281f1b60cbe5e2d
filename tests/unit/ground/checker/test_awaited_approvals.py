"""The time for an approval must not exceed the validity of the skill or of the step."""

from reference.sources import found, mission, policy, program, skill
from virtual.rows import rows

CONFIRM = "confirm probe by role supervisor within 10 min"


@rows(
    ("skill_valid", "step", "findings"),
    [
        ("40 min", "probe()", 0),
        ("10 min", "probe()", 0),
        ("599 s", "probe()", 1),
        ("40 min", "probe() { valid for 10 min }", 0),
        ("40 min", "probe() { valid for 599 s }", 1),
        ("10 min", "probe() { valid for 599 s }", 1),
        ("599 s", "probe() { valid for 598 s }", 1),  # said of the skill already
        ("40 min", "probe() { deadline 4 s }", 0),
    ],
)
def test_approval_time_is_compared_with_the_validity(skill_valid: str, step: str, findings: int) -> None:
    probe = skill("probe()", valid=f"for {skill_valid}")
    text = program(probe, policy(CONFIRM), mission("takeoff(altitude = 10 m)", step, "return_home()"))
    assert [code for code, _ in found(text)].count("E0806") == findings
