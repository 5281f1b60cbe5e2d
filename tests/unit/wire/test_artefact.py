"""Every artefact begins with its format's name and version."""

import pytest

from rtshcua.wire import cbor, names
from rtshcua.wire.artefact import ArtefactError, unwrap, wrap
from virtual.rows import rows


def test_bytes_begin_with_name_and_version():
    data = wrap(names.POLICY, {"a": 1})
    assert data == b"\x83\x6ertshcua/policy\x07\xa1\x61a\x01"
    assert unwrap(names.POLICY, data) == {"a": 1}


@rows(
    ("data", "slug", "text"),
    [
        (b"", "malformed", "this is no `rtshcua/policy`: not canonical CBOR: ends where an item should begin (byte 0)"),
        (cbor.encode(1), "malformed", "this is no `rtshcua/policy`: not an array of format name, version and body"),
        (
            cbor.encode(("rtshcua/policy", True, 1)),
            "malformed",
            "this is no `rtshcua/policy`: not an array of format name, version and body",
        ),
        (
            cbor.encode(("rtshcua/policy", 1)),
            "malformed",
            "this is no `rtshcua/policy`: not an array of format name, version and body",
        ),
        (wrap(names.MISSION, 1), "unknown-format", "this is `rtshcua/mission`, not `rtshcua/policy`"),
        (
            cbor.encode(("rtshcua/policy", 8, 1)),
            "unknown-version",
            "`rtshcua/policy` version 8 is unknown here; only version 7 is read",
        ),
        (
            cbor.encode(("rtshcua/policy", 5, 1)),
            "unknown-version",
            "`rtshcua/policy` version 5 is unknown here; only version 7 is read; "
            "docs/compatibility.md says what reads earlier ones",
        ),
    ],
)
def test_anything_else_is_refused(data, slug, text):
    with pytest.raises(ArtefactError) as refused:
        unwrap(names.POLICY, data)
    assert (refused.value.slug, str(refused.value)) == (slug, text)
