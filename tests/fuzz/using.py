"""Every command that reads a store, on one whose digests are right whatever it holds."""

import contextlib
import hashlib
import json
import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mocapidx.errors import MocapidxError
from mocapidx.features.featureset import load_feature_set
from mocapidx.store import schema
from mocapidx.store.read import open_store
from mocapidx.synthesis.spaces import FitOptions
from mocapidx.tasks.align import AlignOptions, align_motions, path_records, segment_records
from mocapidx.tasks.annotate import annotate_motion
from mocapidx.tasks.blend import fit_blend_space
from mocapidx.tasks.blend_examples import ExampleOptions
from mocapidx.tasks.compact import compact_store
from mocapidx.tasks.compare import compare_methods
from mocapidx.tasks.evaluate import EvaluationOptions, evaluate_records
from mocapidx.tasks.export import ExportOptions, export_clips
from mocapidx.tasks.features import check_features, draw_features
from mocapidx.tasks.index import index_files
from mocapidx.tasks.info import document_info, list_documents
from mocapidx.tasks.label_files import Label, LabelFile
from mocapidx.tasks.learn import learn_classes
from mocapidx.tasks.learn_thresholds import learn_feature
from mocapidx.tasks.match import MatchOptions, match_records, match_store
from mocapidx.tasks.merge import merge_stores
from mocapidx.tasks.oneshot import query_auto
from mocapidx.tasks.plot import draw_distances
from mocapidx.tasks.plot_features import draw_feature_matrix, draw_list_sizes
from mocapidx.tasks.query import query_store
from mocapidx.tasks.reindex import reindex_store
from mocapidx.tasks.report import make_report
from mocapidx.tasks.retrieve import RetrieveOptions, retrieve
from mocapidx.tasks.transcribe import TRANSCRIPTS, transcribe
from mocapidx.tasks.verify import verify_store
from mocapidx.tasks.web import build_web
from tests.fuzz import forging

__all__ = ["COMMANDS", "forge_anything", "use"]

F39 = load_feature_set("f39")
COMMANDS_EACH = 4
"""On one store; the next one gets others."""


def forge_anything(store, rng, number):
    """Damage the index, the arrays or the manifest of a store, with right digests."""
    if number % 3 == 0:
        forging.forge_arrays(store, rng, number)
    elif number % 3 == 1:
        forging.forge_index(store, rng, number)
    else:
        place = store / schema.MANIFEST
        place.write_bytes(forging.forged_lines(place.read_bytes(), [], rng))


@dataclass(frozen=True)
class Asked:
    """A store, what it calls its documents, and where results go."""

    store: Path
    names: list[str]
    folder: Path

    @property
    def first(self):
        return self.names[0]

    @property
    def last(self):
        return self.names[-1]

    @property
    def templates(self):
        return self.store.parent / "t.mt"

    @property
    def picture(self):
        return self.folder / "picture.png"

    @property
    def records(self):
        """Hits in all documents, as a file."""
        path = self.folder / "hits.jsonl"
        rows = [
            {"document": name, "start_time": 0, "end_time": 0.4, "label": "plain"}
            for name in self.names
        ]
        path.write_text("".join(json.dumps(row) + "\n" for row in rows))
        return path

    @property
    def labels(self):
        """Two classes, each in two groups of documents."""
        return LabelFile(
            tuple(
                Label(name, ("plain", "squat")[number % 2], 0.0, 0.4, f"{number // 2}", "here")
                for number, name in enumerate(self.names)
            )
        )

    @property
    def parts(self):
        """The beginnings of two documents as labels in files."""
        paths = self.folder / "positive.csv", self.folder / "negative.csv"
        for path, name in zip(paths, (self.first, self.last), strict=True):
            path.write_text(
                f'document,label,start_time,end_time\n"{name}",x,0,0.2\n', errors="surrogateescape"
            )
        return paths


def fit(asked):
    kick = asked.folder / "kick.toml"
    kick.write_text(
        '[[parameter]]\njoint = "rankle"\naxes = "y"\nwhen = { max = "height", joint = "rankle" }\n'
    )
    options = ExampleOptions(store=asked.store)
    fit_blend_space(asked.records, str(kick), examples=options, options=FitOptions(draws=5))


def match(asked):
    web = asked.folder / "own.web"
    build_web(asked.store, web, map_fn=map)
    query = f"{asked.first}@0:0.4"
    match_records(match_store(asked.store, web, query, MatchOptions(epsilon=0.1)))


def align(asked):
    options = AlignOptions(distance="words" if len(asked.first) % 2 else "poses")
    found = align_motions(asked.first, asked.last, options, store=asked.store)
    list(path_records(found))
    list(segment_records(found))


def index(asked):
    """Bring it up to date: all of its documents are looked for where it says that they were."""
    folder = asked.folder / "takes"
    folder.mkdir()
    index_files([folder], asked.store)


COMMANDS: dict[str, Callable[[Asked], object]] = {
    "info DOCUMENT": lambda to: [document_info(to.store, name) for name in to.names],
    "info --where": lambda to: list_documents(to.store, "seconds > 0.1 and not document = b*"),
    "retrieve": lambda to: retrieve(to.store, to.templates, "plain"),
    "retrieve --keyframes": lambda to: retrieve(
        to.store, to.templates, "plain", RetrieveOptions(keyframes="auto")
    ),
    "annotate": lambda to: annotate_motion([to.store], to.templates),
    "learn-mt": lambda to: learn_classes(to.store, to.labels, map_fn=map),
    "query --select auto": lambda to: query_auto(to.store, to.first),
    "query --select relax": lambda to: query_store(to.store, to.first, select="relax"),
    "query --rank dtw": lambda to: query_store(to.store, to.first, rank="dtw"),
    "query --rank template": lambda to: query_store(to.store, to.first, rank="template"),
    "query --scene": lambda to: query_store(to.store, scene="kick-then-punch", explain=True),
    "evaluate --baselines": lambda to: compare_methods(to.store, to.labels),
    "evaluate --store": lambda to: evaluate_records(
        to.records,
        to.labels,
        EvaluationOptions(store=to.store, templates=to.templates, all_classes=True),
    ),
    "plot distance": lambda to: draw_distances(
        to.store, to.templates, to.picture, documents=[to.first]
    ),
    "plot matrix": lambda to: draw_feature_matrix(to.store, to.picture, document=to.last),
    "plot lists": lambda to: draw_list_sizes(to.store, to.picture),
    "features check": lambda to: list(check_features(F39, [to.store])),
    "features plot": lambda to: draw_features(
        F39, "F20,F37", to.store, to.picture, document=to.first
    ),
    "features learn-threshold": lambda to: learn_feature([to.store], F39, "F20", *to.parts),
    "align": align,
    "web build, match": match,
    "blend fit": fit,
    "report": lambda to: make_report(to.store, to.records),
    "export": lambda to: export_clips(
        to.records, to.folder / "clips", ExportOptions(stores=(to.store,))
    ),
    "export --to labels": lambda to: [
        transcribe(to.records, kind, [to.store]) for kind in TRANSCRIPTS
    ],
    "reindex": lambda to: reindex_store(to.store, to.folder / "other.store", "f31"),
    "merge": lambda to: merge_stores([to.store], to.folder / "merged.store"),
    "index": index,
    "compact": lambda to: compact_store(to.store),
    "verify --repair": lambda to: verify_store(to.store, repair=True),
}


def use(store: Path):
    """Run some commands one after the other; each may say that the store is damaged."""
    with open_store(store) as snapshot:
        names = [placed.document.name for placed in snapshot.documents()] or ["none.amc"]
    folder = store.parent / "results"
    manifest = (store / schema.MANIFEST).read_bytes()
    chosen = random.Random(hashlib.md5(manifest).digest()).sample(sorted(COMMANDS), COMMANDS_EACH)
    # What writes to the store comes last.
    for name in sorted(chosen, key=("index", "compact", "verify --repair").count):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        with contextlib.suppress(MocapidxError):
            COMMANDS[name](Asked(store, names, folder))
    return ""
