"""The table of formats."""

from rtshcua.wire import names


def test_names_and_content_types_are_unique():
    assert len({artefact.name for artefact in names.ALL}) == len(names.ALL)
    assert len({artefact.content_type for artefact in names.ALL}) == len(names.ALL)


def test_the_table_is_whole():
    assert set(names.ALL) == {value for value in vars(names).values() if isinstance(value, names.Artefact)}


def test_content_types():
    assert names.POLICY.content_type == "application/vnd.rtshcua.policy+cbor"
    assert names.MISSION_SPEC.content_type == "application/vnd.rtshcua.mission-spec+json"
    assert names.LOG.content_type == "application/vnd.rtshcua.log"
