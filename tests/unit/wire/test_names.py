"""The table of formats."""

from rtshcua.wire import names


def test_names_and_content_types_are_unique():
    table = [value for value in vars(names).values() if isinstance(value, names.Artefact)]
    assert len({artefact.name for artefact in table}) == len(table) == 19
    assert len({artefact.content_type for artefact in table}) == len(table)


def test_content_types():
    assert names.POLICY.content_type == "application/vnd.rtshcua.policy+cbor"
    assert names.MISSION_SPEC.content_type == "application/vnd.rtshcua.mission-spec+json"
    assert names.LOG.content_type == "application/vnd.rtshcua.log"
