"""Files that are imported: plans, KML, and zones in all forms of JSON."""

import json
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from fuzz.mutation.trees import mutated_json as mutated
from reference import qgc_plans, zone_files
from rtshcua.app import importing
from rtshcua.app.importing import ImportRequest
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.exchange.losses import NotReadable

MAX_LENGTH = 6_000
REQUEST = ImportRequest(Path("probe.json"), skip=("all",), terrain="400..460", clock="+02:00", width="20")

__all__ = ["MAX_LENGTH", "mutated", "one", "seeds"]


def seeds() -> Iterable[bytes]:
    values = (
        qgc_plans.plan(qgc_plans.TAKEOFF, qgc_plans.at(16, 2, 1, 20, 5), polygons=[qgc_plans.fence()]),
        qgc_plans.plan(qgc_plans.TAKEOFF, qgc_plans.mapped(), qgc_plans.structure()),
        zone_files.ed269(), zone_files.ed318(), zone_files.faa(), zone_files.geojson({"name": "field"}),
        zone_files.openaip((2500, 1, 1), (0, 1, 0)),
    )  # fmt: skip
    yield from (json.dumps(each).encode() for each in values)


def one(data: bytes) -> None:
    terms = importing._terms(REQUEST)
    assert not isinstance(terms, Refusal)
    with suppress(NotReadable):
        found = importing._by_kind(REQUEST, terms, data)
        assert isinstance(found, Refusal) or not found.not_kept
