"""Every artefact begins with its format's name and version."""

import pytest

from rtshcua.wire import cbor, names
from rtshcua.wire.artefact import ArtefactError, unwrap, wrap
from virtual.rows import rows


def test_bytes_begin_with_name_and_version():
    data = wrap(names.POLICY, {"a": 1})
    assert data == b"\x83\x6ertshcua/policy\x08\xa1\x61a\x01"
    assert unwrap(names.POLICY, data) == {"a": 1}


@rows(
    ("data", "slug", "text"),
    [
        (b"", "malformed", "not a `rtshcua/policy`: not canonical CBOR: unexpected end before an item (byte 0)"),
        (cbor.encode(1), "malformed", "not a `rtshcua/policy`: expected an array of format name, version and body"),
        (
            cbor.encode(("rtshcua/policy", True, 1)),
            "malformed",
            "not a `rtshcua/policy`: expected an array of format name, version and body",
        ),
        (
            cbor.encode(("rtshcua/policy", 1)),
            "malformed",
            "not a `rtshcua/policy`: expected an array of format name, version and body",
        ),
        (wrap(names.MISSION, 1), "unknown-format", "expected `rtshcua/policy`, found `rtshcua/mission`"),
        (
            cbor.encode(("rtshcua/policy", 9, 1)),
            "unknown-version",
            "`rtshcua/policy` version 9 is not supported; this program reads version 8",
        ),
        (
            cbor.encode(("rtshcua/policy", 5, 1)),
            "unknown-version",
            "`rtshcua/policy` version 5 is not supported; this program reads version 8; "
            "see docs/compatibility.md for earlier versions",
        ),
    ],
)
def test_anything_else_is_refused(data, slug, text):
    with pytest.raises(ArtefactError) as refused:
        unwrap(names.POLICY, data)
    assert (refused.value.slug, str(refused.value)) == (slug, text)


@rows(
    ("data", "slug", "text"),
    [
        (
            wrap(names.MISSION, 0)[:-1] + b"\xff",
            "unknown-format",
            "expected `rtshcua/policy`, found `rtshcua/mission`",
        ),
        (b"\x83\x62\xff\xfe\x01", "unknown-format", "expected `rtshcua/policy`, found `\ufffd\ufffd`"),
        (
            b"\x83\x6ertshcua/policy\x20",
            "unknown-version",
            "`rtshcua/policy` version -1 is not supported; this program reads version 8; "
            "see docs/compatibility.md for earlier versions",
        ),
        (
            b"\x83\x6ertshcua/policy\x1b" + b"\xff" * 8 + b"\x00",
            "malformed",
            "not a `rtshcua/policy`: not canonical CBOR: integer does not fit in 64 bits (byte 16)",
        ),
        (
            b"\x83\x78\xff\x00\x00",
            "malformed",
            "not a `rtshcua/policy`: not canonical CBOR: string is longer than the remaining bytes (byte 1)",
        ),
    ],
)
def test_name_and_version_are_checked_first(data, slug, text):
    with pytest.raises(ArtefactError) as refused:
        unwrap(names.POLICY, data)
    assert (refused.value.slug, str(refused.value)) == (slug, text)


def test_more_items_than_an_artefact_has_are_malformed():
    most = tuple(range(names.FEW - 4))
    assert unwrap(names.BUNDLE, wrap(names.BUNDLE, most)) == most
    with pytest.raises(ArtefactError, match="more than 64 items"):
        unwrap(names.BUNDLE, wrap(names.BUNDLE, (*most, 1)))
    assert len(unwrap(names.POLICY, wrap(names.POLICY, (*most, 1)))) == len(most) + 1
    with pytest.raises(ArtefactError, match="more than 10 items"):
        unwrap(names.POLICY, wrap(names.POLICY, most), items=10)
