"""Search an archive of motion capture by what happens in it.

Everything a command does is one call away, with NumPy arrays in and out, time first. The names
below are imported when they are first used, so that ``import mocapidx`` stays light.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mocapidx.features.extract import extract_features
    from mocapidx.features.featureset import FeatureSet, load_feature_set
    from mocapidx.model import Hit, Motion
    from mocapidx.store.read import Snapshot as Store
    from mocapidx.store.read import open_store
    from mocapidx.tasks.align import align_motions
    from mocapidx.tasks.annotate import annotate_motion
    from mocapidx.tasks.blend import fit_blend_space, make_motion
    from mocapidx.tasks.cluster import cluster_mapping
    from mocapidx.tasks.compact import compact_store
    from mocapidx.tasks.doctor import examine
    from mocapidx.tasks.export import export_clips
    from mocapidx.tasks.index import index_files
    from mocapidx.tasks.info import document_info, store_info
    from mocapidx.tasks.learn import find_labels, learn_classes
    from mocapidx.tasks.learn_thresholds import learn_feature
    from mocapidx.tasks.match import match_store
    from mocapidx.tasks.match_graphs import read_graph
    from mocapidx.tasks.merge import merge_stores
    from mocapidx.tasks.oneshot import query_auto
    from mocapidx.tasks.query import query_store
    from mocapidx.tasks.read import read_motion
    from mocapidx.tasks.reindex import reindex_store
    from mocapidx.tasks.remove import remove_documents
    from mocapidx.tasks.report import make_report
    from mocapidx.tasks.retrieve import retrieve
    from mocapidx.tasks.skeleton_report import skeleton_report
    from mocapidx.tasks.transcribe import export_transcripts
    from mocapidx.tasks.verify import verify_store
    from mocapidx.tasks.web import build_web, web_info
    from mocapidx.templates.file import load_templates
    from mocapidx.templates.template import MotionTemplate

__all__ = [
    "FeatureSet",
    "Hit",
    "Motion",
    "MotionTemplate",
    "Store",
    "align_motions",
    "annotate_motion",
    "build_web",
    "cluster_mapping",
    "compact_store",
    "document_info",
    "examine",
    "export_clips",
    "export_transcripts",
    "extract_features",
    "find_labels",
    "fit_blend_space",
    "index_files",
    "learn_classes",
    "learn_feature",
    "load_feature_set",
    "load_templates",
    "make_motion",
    "make_report",
    "match_store",
    "merge_stores",
    "open_store",
    "query_auto",
    "query_store",
    "read_graph",
    "read_motion",
    "reindex_store",
    "remove_documents",
    "retrieve",
    "skeleton_report",
    "store_info",
    "verify_store",
    "web_info",
]

_HOMES = {
    "FeatureSet": "features.featureset:FeatureSet",
    "Hit": "model:Hit",
    "Motion": "model:Motion",
    "MotionTemplate": "templates.template:MotionTemplate",
    "Store": "store.read:Snapshot",
    "align_motions": "tasks.align:align_motions",
    "annotate_motion": "tasks.annotate:annotate_motion",
    "build_web": "tasks.web:build_web",
    "cluster_mapping": "tasks.cluster:cluster_mapping",
    "compact_store": "tasks.compact:compact_store",
    "document_info": "tasks.info:document_info",
    "examine": "tasks.doctor:examine",
    "export_clips": "tasks.export:export_clips",
    "export_transcripts": "tasks.transcribe:export_transcripts",
    "extract_features": "features.extract:extract_features",
    "find_labels": "tasks.learn:find_labels",
    "fit_blend_space": "tasks.blend:fit_blend_space",
    "index_files": "tasks.index:index_files",
    "learn_classes": "tasks.learn:learn_classes",
    "learn_feature": "tasks.learn_thresholds:learn_feature",
    "load_feature_set": "features.featureset:load_feature_set",
    "load_templates": "templates.file:load_templates",
    "make_motion": "tasks.blend:make_motion",
    "make_report": "tasks.report:make_report",
    "match_store": "tasks.match:match_store",
    "merge_stores": "tasks.merge:merge_stores",
    "open_store": "store.read:open_store",
    "query_auto": "tasks.oneshot:query_auto",
    "query_store": "tasks.query:query_store",
    "read_graph": "tasks.match_graphs:read_graph",
    "read_motion": "tasks.read:read_motion",
    "reindex_store": "tasks.reindex:reindex_store",
    "remove_documents": "tasks.remove:remove_documents",
    "retrieve": "tasks.retrieve:retrieve",
    "skeleton_report": "tasks.skeleton_report:skeleton_report",
    "store_info": "tasks.info:store_info",
    "verify_store": "tasks.verify:verify_store",
    "web_info": "tasks.web:web_info",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mocapidx' has no attribute {name!r}")
    module, _, attribute = _HOMES[name].partition(":")
    return getattr(importlib.import_module(f"mocapidx.{module}"), attribute)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
