"""Every command that reads a store, on one whose digests are right whatever it holds."""

import contextlib
import json
from pathlib import Path

from mocapidx.errors import MocapidxError
from mocapidx.store import schema
from mocapidx.store.read import open_store
from mocapidx.tasks.annotate import annotate_motion
from mocapidx.tasks.index import compact_store
from mocapidx.tasks.merge import merge_stores
from mocapidx.tasks.oneshot import query_auto
from mocapidx.tasks.query import query_store
from mocapidx.tasks.reindex import reindex_store
from mocapidx.tasks.report import make_report
from mocapidx.tasks.retrieve import retrieve
from mocapidx.tasks.web import build_web
from tests.fuzz import forging

__all__ = ["forge_anything", "use"]


def forge_anything(store, rng, number):
    """Damage the index, the arrays or the manifest of a store, with right digests."""
    if number % 3 == 0:
        forging.forge_arrays(store, rng, number)
    elif number % 3 == 1:
        forging.forge_index(store, rng, number)
    else:
        place = store / schema.MANIFEST
        place.write_bytes(forging.forged_lines(place.read_bytes(), [], rng))


def use(store: Path):
    """Run the commands one after the other; each may say that the store is damaged."""
    with open_store(store) as snapshot:
        names = [placed.document.name for placed in snapshot.documents()]
    rows = [{"document": n, "start_time": 0, "end_time": 0.1, "label": "plain"} for n in names]
    hits, templates = store.parent / "hits.jsonl", store.parent / "t.mt"
    hits.write_text("".join(json.dumps(row) + "\n" for row in rows))
    for work in (
        lambda: retrieve(store, templates, "plain"),
        lambda: annotate_motion([store], templates),
        lambda: query_auto(store, names[0]),
        lambda: query_store(store, names[0], rank="template"),
        lambda: query_store(store, scene="kick-then-punch", explain=True),
        lambda: build_web(store, store.parent / "new.web", map_fn=map),
        lambda: make_report(store, hits),
        lambda: reindex_store(store, store.parent / "other.store", "f31"),
        lambda: merge_stores([store], store.parent / "merged.store"),
        lambda: compact_store(store),
    ):
        with contextlib.suppress(MocapidxError):
            work()
    return ""
