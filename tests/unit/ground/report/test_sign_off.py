"""The sign-off of a page, and the explanations that its reader needs: reasons, links, changes."""

import re
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from rtshcua.front.cli.app import main
from rtshcua.ground.report.glance import glance
from rtshcua.ground.report.html_page import page
from rtshcua.ground.report.policy_changes import ELSE
from rtshcua.ground.report.policy_report import ReportPart, policy_report
from rtshcua.ground.report.report_model import ChangeView, PolicyReport
from rtshcua.ground.testing.boundaries.draft import GENERATED
from rtshcua.model.flat.policy import AfterSilence, WithoutEvidence
from rtshcua.model.outcome import Reason

EVERYTHING = Path(__file__).with_name("everything.rts")


def words(markup: str) -> str:
    """The visible text of a page."""
    return " ".join(unescape(re.sub(r"<[^>]*>", "", markup)).split())


@pytest.mark.slow
def test_page_begins_with_a_summary(everything: PolicyReport) -> None:
    text = page(everything)
    (chapter,) = everything.chapters
    glance, sign, contents = (text.index(f'id="{each}"') for each in ("p1-glance", "p1-sign", "contents"))
    assert glance < sign < contents < text.index('id="p1"')
    first = words(text[glance:sign])
    heads = ("Who may have what done", "Where", "How high", "How fast", "What needs a person",
             "When something goes wrong", "What is not covered")  # fmt: skip
    places = [first.index(each) for each in heads]
    assert places == sorted(places)
    box = words(text[sign:contents])
    assert "the policy everything version 3 with the digest" in box
    assert chapter.digest in box.replace(" ", "")
    assert "these missions, as it lists them, fly under it: look." in box


def test_summary_agrees_with_the_chapter(standard: PolicyReport) -> None:
    (chapter,) = standard.chapters
    first = glance(chapter)
    assert {fact.what for fact in first.who} == {"role `operator`", "role `supervisor`", "everybody else"}
    assert any("after approval" in fact.value or "on conditions" in fact.value for fact in first.who)
    assert first.where[0] == chapter.airspace
    assert any(each.startswith("`city`: ") and "120 m" in each for each in first.height)
    assert "`takeoff` is permitted with `altitude` between 3 m and 40 m above home" in first.height, "of up to 60 m"
    inspected = "`inspect_area` is permitted with `altitude` between 5 m and 30 m above home, under conditions"
    assert inspected in first.height
    assert "`goto` is permitted with `speed` between 1 m/s and 8 m/s, under conditions" in first.speed
    flown_to = "`goto` is permitted if the `target` asked for is inside `city`"
    assert any(each.startswith(flown_to) for each in first.where)
    assert any("approved by a person of the role `supervisor`" in each for each in first.person)
    told = {fact.what: fact.value for fact in first.wrong}
    assert told["Records cannot be kept"] == chapter.evidence
    assert told["A step is denied in the air"] == " ".join(chapter.contingency)
    assert any("`battery`" in each for each in first.beyond), "what is known"
    assert any("does not have the sensor" in each for each in first.beyond)


def test_summary_states_what_a_policy_does_not_have(everything: PolicyReport) -> None:
    (chapter,) = everything.chapters
    bare = replace(
        chapter, missions=(), cases=(), scenarios=(), zones=(), contingency=(), skills=(), signals=(),
        rules=tuple(each for each in chapter.rules if each.kind not in ("confirm", "degrade")), rules_left_out=(),
        permitted=(),
    )  # fmt: skip
    first = glance(bare)
    assert first.person == ("Nothing: no rule requires a person to approve a step.",)
    assert first.height == ("This policy does not limit the height.",)
    assert any("No mission is listed" in each for each in first.beyond)
    assert any("no test of this policy" in each for each in first.beyond)
    many = replace(chapter, rules=tuple(replace(chapter.rules[0], kind="confirm", number=each) for each in range(9)))
    assert glance(many).person[-1] == "3 more: see the rules"


def test_only_generated_tests_are_folded(everything: PolicyReport) -> None:
    (chapter,) = everything.chapters
    cases = (*chapter.cases, *(replace(each, generated=True) for each in chapter.cases))
    text = page(replace(everything, chapters=(replace(chapter, cases=cases),)))
    folded = text.partition('<details class="folded">')[2].partition("</details>")[0]
    assert f"{len(chapter.cases)} generated case" in folded
    assert folded.count('<tr><th scope="row">') == len(chapter.cases)
    before = text.partition('id="p1-cases"')[2].partition("<details")[0]
    assert before.count('<tr><th scope="row">') == len(chapter.cases)
    assert "<details" not in page(everything)


def test_generated_file_is_recognised_by_its_head(tmp_path: Path, part: Callable[[Path], ReportPart]) -> None:
    made = tmp_path / "limits.rts"
    policy = EVERYTHING.parents[4] / "policies" / "bridge_inspection.rts"
    assert main(["test", str(policy), "--generate", "--skill", "hover", "-o", str(made)]) == 0
    assert made.read_text().startswith(GENERATED)
    (chapter,) = policy_report([part(made)], made_at_us=0, made_by="x").chapters
    assert chapter.cases
    assert all(each.generated for each in chapter.cases)


def test_sign_off_without_missions_lists_none(everything: PolicyReport) -> None:
    bare = replace(everything, chapters=(replace(everything.chapters[0], missions=()),))
    assert "no missions" in words(page(bare).partition('id="p1-sign"')[2])


def test_each_policy_has_a_sign_off_box(everything: PolicyReport) -> None:
    text = page(replace(everything, chapters=everything.chapters * 2))
    assert text.index('id="p1-sign"') < text.index('id="p2-sign"') < text.index('id="contents"')


@pytest.mark.parametrize(("count", "length"), [(1, 64), (4, 64), (5, 32)])
def test_printed_footer_has_the_whole_digest_if_it_fits(everything: PolicyReport, count: int, length: int) -> None:
    (chapter,) = everything.chapters
    foot = re.search(r'@bottom-left \{ content: "(.*?)"', page(replace(everything, chapters=(chapter,) * count)))
    assert foot is not None
    assert re.findall(r"everything 3: ([0-9a-f]+)", foot[1]) == [chapter.digest[:length]] * count


def test_every_reason_has_an_explanation_with_links_to_it(everything: PolicyReport) -> None:
    text = page(everything)
    for reason in Reason:
        anchor = f"reason-{reason.value.replace('/', '-')}"
        found = re.search(rf'<dt id="{anchor}"><code>{reason.value}</code></dt><dd>(.*?)</dd>', text)
        assert found is not None, reason
        assert words(found[1]).endswith("."), reason
    assert '<a href="#reason-authority-forbidden"><code>authority/forbidden</code></a>' in text


def test_last_link_is_described_as_checked_if_requested_as_a_step(everything: PolicyReport) -> None:
    (chapter,) = everything.chapters
    assert [skill.name for skill in chapter.skills if skill.as_link] == ["emergency_land"]
    text = words(page(everything))
    assert text.count("Requested as a step, it is checked against the rules (degrade too) and the charge like any") == 1


def changes(part: ReportPart, **other: object) -> dict[str, ChangeView]:
    """The changes since an earlier policy with other fields."""
    new = part.policies[0].policy
    book = policy_report([part], made_at_us=0, made_by="x", earlier=[replaced(new, **other)], since="old")
    return {each.what: each for each in book.chapters[0].changes}


def replaced(flat: Any, **other: object) -> Any:
    return type(flat)(**{**{name: getattr(flat, name) for name in flat.__struct_fields__}, **other})


def test_change_has_old_and_new_text(part: Callable[[Path], ReportPart]) -> None:
    everything = part(EVERYTHING)
    policy = everything.policies[0].policy
    told = changes(everything, airspace=None, without_evidence=int(WithoutEvidence.LAND))
    assert told["the airspace"].before[0].startswith("This policy does not limit where")
    assert told["the airspace"].after[0].startswith("The vehicle may only be inside of `yard` and outside of `works`")
    assert "comes down" in told["the action without evidence"].before[0]
    assert "may finish" in told["the action without evidence"].after[0]
    told = changes(everything, silence_us=30_000_000, after_silence=int(AfterSilence.CONTINGENCY))
    (silence,) = told.values()
    assert silence.what == "the action after a silence of the vehicle"
    assert "longer than 30 s, the mission is aborted" in silence.before[0]
    assert "longer than 45 s, the step goes on" in silence.after[0]
    told = changes(everything, contingency=policy.contingency[1:])
    assert told["the contingency"].before == ("`return_home`, then `emergency_land`",)
    assert told["the contingency"].after[0].startswith("`hover` with `time` 10 s for at most 10 s, then `return_home`")
    book = policy_report(
        [everything], made_at_us=0, made_by="x", earlier=[replaced(policy, airspace=None)], since="old"
    )
    assert "This policy does not limit where" in words(page(book))


def test_changed_vehicle_zone_and_skill_have_old_and_new_text(part: Callable[[Path], ReportPart]) -> None:
    everything = part(EVERYTHING)
    policy = everything.policies[0].policy
    slower = replaced(policy.vehicle, speed=5_000, return_altitude=0, braking=0, reaction_us=0)
    (told,) = changes(everything, vehicle=slower).values()
    assert told.what == "the vehicle (speed, brakes, return)"
    assert told.before == ("speed: at most 5 m/s", "brakes: nothing", "return: nothing")
    assert told.after[0] == "speed: at most 12 m/s"
    assert told.after[2] == "return: at 30 m above home"
    zoned = replaced(policy.vehicle, time_zone="Asia/Kolkata", utc_offset_us=0)
    (told,) = changes(everything, vehicle=zoned).values()
    assert (told.before, told.after) == (("local time: Asia/Kolkata",), ("local time: UTC +02:00",))
    weekly = replaced(policy.zones[0], daily=(), dates=(), weekly=(8 * 3_600_000_000, 90_000_000_000))
    (told,) = changes(everything, zones=(weekly, *policy.zones[1:])).values()
    assert told.before == ("active: every week from Monday 08:00 to Tuesday 00:59 local time",)
    zones = (replaced(policy.zones[0], ceiling=60_000), *policy.zones[1:])
    (told,) = changes(everything, zones=zones).values()
    assert (told.before, told.after) == (("ceiling: 60 m above home",), ("ceiling: 120 m above home",))
    quick = tuple(replaced(each, deadline_us=1_000_000) if each.name == "goto" else each for each in policy.contracts)
    (told,) = changes(everything, contracts=quick).values()
    assert (told.what, told.before, told.after) == (
        "the skill `goto` (deadline)",
        ("deadline: 1 s",),
        ("deadline: 5 s",),
    )
    fresh = (replaced(policy.signals[0], stale_us=9_000_000), *policy.signals[1:])
    (told,) = changes(everything, signals=fresh).values()
    assert told.before == ("stale: after 9 s",)


def test_every_part_of_every_declaration_is_described(part: Callable[[Path], ReportPart]) -> None:
    """Compared with a policy that has no zones, skills and signals of the same names."""
    everything = part(EVERYTHING)
    policy = everything.policies[0].policy
    other = {
        field: tuple(replaced(each, name=f"{each.name}_then") for each in getattr(policy, field))
        for field in ("zones", "contracts", "signals")
    }
    told = changes(everything, **other)
    gone, new = ([each for each in told.values() if not getattr(each, side)] for side in ("after", "before"))
    assert len(gone) == len(new) > 20
    assert not [each for each in told.values() if ELSE in each.after and "rule" not in each.what]
