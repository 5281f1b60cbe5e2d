"""Renaming: refusals by hand; and a property test that all names keep their meaning under the new name."""

import re
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor.rename import RENAMED, Renaming, renamable, rename
from rtshcua.ground.editor.workspace import Workspace
from rtshcua.ground.pipeline.program import check_declared
from rtshcua.mavlink import dialect

DIALECT = dialect.load()
FILES = DIP, LAKE, LOOK, SITE = "/w/dip.rts", "/w/lake.rts", "/w/look.rts", "/w/site.rts"


def place(desk: Workspace, file: str, around: str) -> int:
    text = desk.text(file) or ""
    before, _, after = around.partition("|")
    assert text.count(before + after) == 1, around
    return text.index(before + after) + len(before)


@pytest.mark.parametrize(
    ("file", "around", "name", "why"),
    [
        (SITE, "zone po|nd", "5pond", "is not a valid name"),
        (SITE, "zone po|nd", "a.b", "is not a valid name"),
        (SITE, "zone po|nd", "inside", "reserved word"),
        (SITE, "zone po|nd", "phase", "reserved word"),
        (SITE, "zone po|nd", "lake", "already a policy"),
        (SITE, "zone po|nd", "goto", "already a skill"),
        (SITE, "zone po|nd", "up", "already a parameter of `dip`"),
        (SITE, "zone po|nd", "calm", "already a value of an enumeration of `mood`"),
        (DIP, "mission dip(ov|er", "up", "already a parameter of `dip`"),
        (DIP, "mission dip(ov|er", "pond", "already a zone"),
        (LOOK, "one of slo|w", "fast", "already a choice"),
        (SITE, "{ ca|lm", "wild", "already a value"),
        (DIP, "on survey|or", "drone", "belongs to the library"),
        (DIP, "role oper|ator", "boss", "not declared in a source"),
        (DIP, "phase sur|vey", "look_around", "not declared in a source"),
        (DIP, "{ take|off(", "rise", "belongs to the library"),
        (LOOK, "gps.fi|x", "gps.lock", "belongs to the library"),
        (LOOK, "dead|line", "x", "no name here"),
    ],
)
def test_renaming_is_refused_with_a_reason(desk: Workspace, file: str, around: str, name: str, why: str) -> None:
    found = rename(desk, FILES, desk.view(DIP), file, place(desk, file, around), name, DIALECT)
    assert isinstance(found, Refusal)
    assert why in found.text


def test_renaming_is_refused_while_a_program_has_errors(desk: Workspace) -> None:
    desk.put("/w/half.rts", 'import "site.rts"\nzone half = union(pond')
    found = rename(desk, FILES, desk.view(DIP), SITE, place(desk, SITE, "zone po|nd"), "pool", DIALECT)
    assert isinstance(found, Refusal)
    assert "half.rts` has errors" in found.text


def test_renaming_a_parameter_of_two_skills_is_refused(desk: Workspace) -> None:
    text = (desk.text(LAKE) or "").replace("forbid look by any when target", "forbid look, goto by any when target")
    desk.put(LAKE, text)
    found = renamable(desk, desk.view(DIP), LAKE, place(desk, LAKE, "goto by any when tar|get"))
    assert isinstance(found, Refusal)
    assert "`look` and `goto`: rename each" in found.text


def test_renaming_changes_all_files(desk: Workspace) -> None:
    """A zone with its entry, a parameter in steps and rules, a signal with dots."""
    made = rename(desk, FILES, desk.view(DIP), LOOK, place(desk, LOOK, "height_abov|e: altitude"), "clearance", DIALECT)
    assert isinstance(made, Renaming)
    assert {file.rpartition("/")[2]: len(spans) for file, spans in made.places.items()} == {
        "look.rts": 2, "lake.rts": 1, "dip.rts": 1,
    }  # fmt: skip
    made = rename(desk, FILES, desk.view(DIP), DIP, place(desk, DIP, "look(ov|er.entry"), "where_to", DIALECT)
    assert isinstance(made, Renaming)
    assert "dip(where_to: zone" in made.applied(DIP, desk.text(DIP) or "")
    assert "look(where_to.entry, height_above" in made.applied(DIP, desk.text(DIP) or "")
    made = rename(desk, FILES, desk.view(SITE), SITE, place(desk, SITE, "signal sea|.mood"), "sea.state", DIALECT)
    assert isinstance(made, Renaming)
    assert sorted(made.places) == [DIP, LAKE, LOOK, SITE]


NAMES = st.one_of(
    st.sampled_from(["pond", "phase", "valid", "home", "any", "x", "entry", "calm", "a.b", "grow", "min", "circle"]),
    st.from_regex(re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,6}", re.ASCII), fullmatch=True),
)


@settings(max_examples=settings().max_examples // 4)
@given(st.data(), st.sampled_from(FILES), NAMES)
def test_renamed_program_has_the_same_meaning(make_lake: Workspace, data: st.DataObject, file: str, name: str) -> None:
    view = make_lake.view(DIP)
    places = [each for each in view.occurrences(file) if each.target.kind in RENAMED]
    each = data.draw(st.sampled_from(places))
    made = rename(make_lake, FILES, view, file, each.span.start, name, DIALECT)
    if isinstance(made, Refusal):
        assert made.text
        return
    changed = make_lake.with_texts({other: made.applied(other, view.text(other)) for other in made.places})
    before, after = (
        check_declared(view.program, dialect.load()),
        check_declared(changed.view(DIP).program, dialect.load()),
    )
    assert [one.code for one in after] == [one.code for one in before]
    assert changed.view(DIP).units.keys() == view.units.keys()
    if made.places:  # and back again, which gives the texts as they were
        first = made.places[file][0]
        moved = sum(len(name) - (span.end - span.start) for span in made.places[file] if span.start < first.start)
        back = rename(changed, FILES, changed.view(DIP), file, first.start + moved, each.target.name, DIALECT)
        assert isinstance(back, Renaming)
        assert all(back.applied(one, changed.text(one) or "") == view.text(one) for one in made.places)


def test_changed_places_do_not_overlap(desk: Workspace) -> None:
    made = rename(desk, FILES, desk.view(DIP), SITE, place(desk, SITE, "zone po|nd"), "pool", DIALECT)
    assert isinstance(made, Renaming)
    for spans in made.places.values():
        assert all(one.end <= other.start for one, other in pairwise(sorted(spans)))
        assert all(isinstance(span, Span) for span in spans)
