"""The paper's three queries of section 6.2, with the features that it names, on real motion."""

import pytest

from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.query import query_store

CLASSES = ("squat1Reps", "kickLFront1Reps", "depositFloorR", "throwBasketball", "lieDownFloor")


@pytest.fixture(scope="module")
def store(real_data, tmp_path_factory):
    path = tmp_path_factory.mktemp("stores") / "f31.store"
    inputs = [
        *(real_data / "hdm05" / name for name in CLASSES),
        *sorted((real_data / "bandai").rglob("*_punch_*.bvh")),
        *sorted((real_data / "bandai").rglob("*_walk_*.bvh"))[:8],
        *(real_data / "cmu").rglob("02_05.amc"),
    ]
    index_files(inputs, path, IndexOptions(feature_set="f31", root=real_data))
    return path


def found(store, real_data, example, select):
    hits = query_store(store, f"{real_data / example}", select=select).hits
    return [hit.document for hit in hits]


def share(documents, *words):
    return sum(any(word in name for word in words) for name in documents) / len(documents)


def test_a_punch_finds_punches_and_more_features_find_fewer(store, real_data):
    example = "bandai/1/dataset-1_punch_normal_002.bvh@2.3:4.5"
    hits = found(store, real_data, example, "U1,U2,U7,U8")
    assert len(hits) >= 10
    assert share(hits, "punch", "02_05") == 1  # the CMU take is one of punches and strikes
    assert len(found(store, real_data, example, "U1,U7")) > len(hits)
    assert len(found(store, real_data, example, "U1,U2,U3,U4,U7,U8")) < len(hits)


def test_a_squat_finds_nearly_all_squats_first(store, real_data):
    example = "hdm05/squat1Reps/HDM_bd_squat1Reps_001_120.amc"
    hits = found(store, real_data, example, "L5,L6,L7,L10,L11")
    assert len({name for name in hits if "squat" in name}) >= 34  # of 36
    assert share(hits[:30], "squat") == 1
    without_speed = found(store, real_data, example, "L7,L10,L11")
    assert len(without_speed) > len(hits)
    assert share(without_speed, "squat") < share(hits, "squat")


def test_a_kick_finds_kicks_and_fewer_features_find_more(store, real_data):
    example = "hdm05/kickLFront1Reps/HDM_bd_kickLFront1Reps_001_120.amc"
    hits = found(store, real_data, example, "L3,L4,L7,L8")
    assert len(hits) >= 8
    assert share(hits, "kick") == 1
    assert len(found(store, real_data, example, "L4,L8")) > len(hits)
