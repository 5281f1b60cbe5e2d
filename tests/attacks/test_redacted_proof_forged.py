"""Records shown in part, with a field that is not the one of the record."""

from collections.abc import Callable

from reference.proof_parts import disclosure, inclusion


def test_a_field_that_is_shown_in_part_is_edited() -> None:
    parts = disclosure(3, "detail")
    for at, (key, shown) in enumerate(parts.extra["fields"]):
        fields = list(parts.extra["fields"])
        changed = (bytes(32),) if len(shown) == 1 else (shown[0], b"7" if key not in ("type", "seq") else shown[1])
        if changed == shown:
            continue
        fields[at] = (key, changed)
        made = disclosure(3, "detail")
        made.extra["fields"] = tuple(fields)
        assert made.slug() == "proof/path", key


def test_fields_are_left_out_added_or_moved() -> None:
    fields = disclosure(3, "detail").extra["fields"]
    cases = [fields[1:], fields[::-1], (*fields, fields[-1]), (fields[1], fields[0], *fields[2:]), fields[:-1]]
    for case_ in cases:
        parts = disclosure(3, "detail")
        parts.extra["fields"] = tuple(case_)
        assert parts.slug() == "proof/fields"


def with_field(name: str, parts_of: tuple[bytes, ...] | Callable[[tuple[bytes, ...]], tuple[bytes, ...]]) -> str:
    parts = disclosure(3, "detail")
    parts.extra["fields"] = tuple(
        (key, (parts_of(shown) if callable(parts_of) else parts_of) if key == name else shown)
        for key, shown in parts.extra["fields"]
    )
    return parts.slug()


def test_fields_that_are_none() -> None:
    assert with_field("detail", ()) == "proof/fields"
    assert with_field("detail", (bytes(31),)) == "proof/fields"
    assert with_field("detail", (bytes(32), b"1", b"2")) == "proof/fields"
    assert with_field("event", (bytes(31), b"1")) == "proof/fields"
    assert with_field("event", (bytes(32), b"no JSON")) == "proof/fields"
    assert with_field("event", (bytes(32), b"\xff")) == "proof/fields"
    assert with_field("event", (bytes(32), b"[" * 100_000)) == "proof/fields"


def test_type_and_number_must_be_shown() -> None:
    assert with_field("type", (bytes(32),)) == "proof/fields"
    assert with_field("type", lambda shown: (shown[0], b'"decision"')) == "proof/fields"
    assert with_field("type", lambda shown: (shown[0], b"[]")) == "proof/fields"
    assert with_field("seq", (bytes(32),)) == "proof/fields"
    assert with_field("seq", lambda shown: (shown[0], b"4")) == "proof/fields"
    assert with_field("seq", lambda shown: (shown[0], b"3.0")) == "proof/fields"


def test_a_record_shown_in_part_in_another_place_or_under_another_record() -> None:
    parts = disclosure(3, "detail")
    parts.number = "index 5"
    assert parts.slug() == "proof/fields"
    parts = disclosure(3, "detail")
    parts.path = parts.path[::-1]
    assert parts.slug() == "proof/path"
    parts = disclosure(3, "detail")
    parts.number = "index -3"
    assert parts.slug() == "proof/malformed"
    seal = inclusion(3)
    parts = disclosure(3, "detail")
    parts.note, parts.extra["signed"], parts.extra["chain"] = seal.note, seal.extra["signed"], seal.extra["chain"]
    assert parts.slug() == "proof/disclosure"
