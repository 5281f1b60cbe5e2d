"""Artefacts of each version, in tests/vectors/artefacts: the present version is read, others are refused
by name. `KIND-VERSION` was written by the revision that had that version (docs/compatibility.md), with the keys of
`reference.world`; `policy-N` is a whole bundle, signed rightly (those of versions 1 to 3 anew, with these keys).
"""

import re
from pathlib import Path

import pytest

from reference.documents import low, presented
from reference.world import ROOT, ROOT_KEY, START, try_load
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire import names
from rtshcua.wire.artefact import ArtefactError
from rtshcua.wire.trust import open_root

VECTORS = Path(__file__).parents[2] / "vectors"
PAGE = (Path(__file__).parents[3] / names.COMPATIBILITY).read_text(encoding="utf-8")
FILES = sorted(path.name for path in (VECTORS / "artefacts").iterdir())
KINDS = {"approval": names.APPROVAL, "recall": names.RECALL, "replacement": names.REPLACEMENT, "policy": names.POLICY,
         "root": names.ROOT}  # fmt: skip


def read(kind: str, data: bytes) -> tuple[str, str]:
    """The refusal of an artefact: a slug and a text, both empty if it is accepted."""
    if kind == "root":
        try:
            assert open_root(data, pinned=ROOT_KEY.public, now_us=START.utc_us) == ROOT
        except ArtefactError as error:
            return error.slug, str(error)
        return "", ""
    if kind == "policy":
        found = try_load(data)
        assert isinstance(found, Loaded | Refusal)
        return (found.slug, found.text) if isinstance(found, Refusal) else ("", "")
    receipt = presented(low(), data)
    return ("", "") if receipt.accepted else (receipt.slug, receipt.text)


@pytest.mark.parametrize("name", FILES)
def test_the_present_version_is_read_and_earlier_ones_are_refused_by_name(name: str) -> None:
    kind, _, version = name.rpartition("-")
    slug, text = read(kind, (VECTORS / "artefacts" / name).read_bytes())
    if int(version) == KINDS[kind].version:
        assert (slug, text) == ("", "")
        return
    assert slug == "unknown-version"
    assert text.startswith(f"`rtshcua/{kind}` version {version} is not supported")
    assert names.COMPATIBILITY in text


def test_each_format_that_changed_has_vectors_and_a_row_for_each_version() -> None:
    versions = {kind: artefact.version for kind, artefact in KINDS.items()} | {"log": names.LOG.version}
    for kind, present in versions.items():
        rows = set(re.findall(rf"^\| `rtshcua/{kind}` \| (\d+) \|", PAGE, re.MULTILINE))
        assert rows == {str(version) for version in range(1, present + 1)}, kind
    every = {f"{kind}-{version}" for kind, of in KINDS.items() for version in range(1, of.version + 1)}
    assert every == set(FILES)
    logs = {int(path.name.removeprefix("log-")) for path in VECTORS.glob("log-*")}
    assert logs == set(range(1, names.LOG.version))
