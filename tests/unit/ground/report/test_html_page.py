"""The page is well formed, self-contained, safe against hostile sources, and reproducible."""

import re
from base64 import b64decode
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from html import unescape
from itertools import pairwise
from pathlib import Path

import pytest

from reference.html_outline import Outline
from rtshcua.ground.report.html_page import page
from rtshcua.ground.report.policy_report import ReportPart, policy_report
from rtshcua.ground.report.report_model import PolicyReport
from rtshcua.wire.bundle import policy_digest, policy_payload


@pytest.fixture(scope="module")
def text(everything: PolicyReport) -> str:
    return page(everything)


@pytest.fixture(scope="module")
def outline(text: str) -> Outline:
    return Outline(text)


def test_elements_are_nested_and_closed(outline: Outline) -> None:
    assert outline.wrong == []
    assert outline.open == []


def test_ids_are_unique_and_every_link_has_a_target(outline: Outline) -> None:
    ids = [attributes["id"] for _, attributes in outline.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    links = [attributes["href"] for attributes in outline.of("a")]
    assert len(links) > 50
    assert not {link for link in links if not link.startswith("#") or link[1:] not in ids}
    labelled = {word for _, attributes in outline.elements for word in attributes.get("aria-labelledby", "").split()}
    assert not labelled - set(ids)
    inner = {found for _, each in outline.elements for found in re.findall(r"url\(#(.*?)\)", " ".join(each.values()))}
    assert inner
    assert not inner - set(ids)


def test_page_loads_nothing_and_has_no_script(outline: Outline, text: str) -> None:
    assert not {tag for tag, _ in outline.elements} & {"script", "link", "img", "iframe", "object", "form", "base"}
    for _, attributes in outline.elements:
        assert not {name for name in attributes if name.startswith("on") or name in ("src", "style", "srcset")}
    assert "@import" not in text
    assert "url(http" not in text


def test_content_security_policy_allows_only_the_own_style(outline: Outline, text: str) -> None:
    (policy,) = (each["content"] for each in outline.of("meta") if each.get("http-equiv") == "Content-Security-Policy")
    (style,) = re.findall(r"<style>(.*?)</style>", text, re.DOTALL)
    digest = re.search(r"style-src 'sha256-([^']+)'", policy)
    assert digest is not None
    assert b64decode(digest[1]) == sha256(style.encode()).digest()
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy


def test_tables_and_drawings_have_captions(outline: Outline) -> None:
    tags = [tag for tag, _ in outline.elements]
    assert tags.count("table") == tags.count("caption") > 10
    assert all(attributes.get("scope") in ("col", "row", "rowgroup") for attributes in outline.of("th"))
    assert len(outline.of("svg")) >= 4
    assert all(each["role"] == "img" and each["aria-labelledby"] for each in outline.of("svg"))
    levels = [int(tag[1]) for tag in tags if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))


def test_markup_in_a_source_is_escaped(text: str) -> None:
    """The identity, a comment and the intent of the sample contain markup."""
    for hostile in ("<i>01</i>", '<script>alert("a comment is text")</script>', "<b>everything</b> & come home"):
        assert hostile not in text
        assert hostile in unescape(text)


@pytest.mark.parametrize("hostile", ['"><svg onload=alert(1)>', "</style><script>1</script>", "{{ 7 * 7 }}", "`<b>`"])
def test_hostile_title_is_escaped(everything: PolicyReport, hostile: str) -> None:
    text = page(replace(everything, title=hostile, made_by=hostile))
    outline = Outline(text)
    assert outline.wrong == []
    assert "script" not in {tag for tag, _ in outline.elements}
    assert hostile.replace("`", "") in re.sub(r"</?code>", "", unescape(text))


@pytest.mark.parametrize("hidden", ["\u202e", "\u200b", "\ufeff", "\x07", "\r", "\u2066"])
def test_invisible_and_reordering_characters_are_shown(everything: PolicyReport, hidden: str) -> None:
    text = page(replace(everything, title=f"look{hidden}here"))
    assert hidden not in text
    assert f"look&lt;U+{ord(hidden):04X}&gt;here" in text


def test_same_sources_give_the_same_bytes(part: Callable[[Path], ReportPart], standard: PolicyReport) -> None:
    path = Path(__file__).resolve().parents[4] / "missions" / "standard.rts"
    again = policy_report([part(path)], made_at_us=1_769_846_400_000_000, made_by="rtshcua")
    assert again == standard
    assert page(again).encode() == page(standard).encode()
    assert "2026-01-31 08:00 UTC" in page(again)


def test_digest_is_that_of_the_signed_policy(part: Callable[[Path], ReportPart], standard: PolicyReport) -> None:
    path = Path(__file__).resolve().parents[4] / "missions" / "standard.rts"
    signed = policy_digest(policy_payload(part(path).missions[0].policy)).hex()
    assert [chapter.digest for chapter in standard.chapters] == [signed]
    shown = re.findall(r'class="digest">(.*?)</(?:td|dd|p)>', page(standard), re.DOTALL)
    assert sum(re.sub(r"<[^>]*>|\s", "", each) == signed for each in shown) == 3


def test_policy_of_two_programs_is_one_chapter(part: Callable[[Path], ReportPart]) -> None:
    """With the missions of both."""
    missions = Path(__file__).resolve().parents[4] / "missions"
    book = policy_report([part(missions / "standard.rts"), part(missions / "extended.rts")], made_at_us=0, made_by="x")
    (chapter,) = book.chapters
    assert [mission.name for mission in chapter.missions] == ["standard", "extended"]


def test_changes_are_listed_and_marked(part: Callable[[Path], ReportPart]) -> None:
    everything = part(Path(__file__).with_name("everything.rts"))
    new = everything.policies[0].policy
    old = type(new)(**{**{name: getattr(new, name) for name in new.__struct_fields__}, "rules": new.rules[1:]})
    book = policy_report([everything], made_at_us=0, made_by="x", earlier=[old], since="old.bundle")
    (chapter,) = book.chapters
    assert chapter.since == "old.bundle"
    assert len(chapter.changes) == 1
    assert [rule.number for rule in chapter.rules if rule.changed] == [1]
    assert "old.bundle" in page(book)
    same = policy_report([everything], made_at_us=0, made_by="x", earlier=[new], since="old.bundle")
    assert same.chapters[0].changes == ()
    assert "It means the same" in page(same)


def test_page_has_tests_and_missions(everything: PolicyReport, text: str) -> None:
    (chapter,) = everything.chapters
    assert [case.name for case in chapter.cases] == [
        'an approval is "waited" for', "charge decides", "charge decides", "another policy", "too windy",
    ]  # fmt: skip
    (mission,) = chapter.missions
    assert [step.number for step in mission.steps] == [1, 2, 3, 4, 5]
    assert mission.steps[2].tighter == ("it begins within 4 s of its turn", "before it begins: `battery > 50 %`")
    assert "an approval is &#34;waited&#34; for" in text
    (scenario,) = chapter.scenarios
    assert scenario.name == "a gust on the way"
    assert scenario.told[0] == "the mission `look` is flown on the simulated vehicle"
    assert 'id="p1-scenarios"' in text
    assert "They were not flown when this page was made" in text
    assert "a breach is answered within " in text


def luminance(colour: str) -> float:
    """WCAG 2.2, relative luminance."""
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_text_has_sufficient_contrast_in_light_and_dark(text: str) -> None:
    """At least 4.5 to 1 (WCAG 2.2, AA) on the page and in the heads of tables, 3 to 1 for the lines of a map."""
    faces = re.findall(r":root \{(.*?)\}", text, re.DOTALL)
    assert len(faces) == 3  # light, dark, paper
    for face in faces[:2]:
        colours = dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6});", face))

        def ratio(one: str, other: str, known: dict[str, str] = colours) -> float:
            light, dark = sorted((luminance(known[one]), luminance(known[other])), reverse=True)
            return (light + 0.05) / (dark + 0.05)

        for ink in ("ink", "soft", "link", "good", "bad", "warn"):
            assert ratio(ink, "page") >= 4.5, ink
            assert ratio(ink, "band") >= 4.5, ink
        for line in ("allowed-line", "forbidden-line", "other-line", "way"):
            assert ratio(line, "sheet") >= 3, line
            assert ratio(line, "allowed") >= 3, line
