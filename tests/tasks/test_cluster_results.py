"""Every command that takes --scheduler says the same serially, in processes and on a cluster."""

import pytest

from mocapidx.tasks.index import IndexOptions, index_files
from tests.made_cluster import made_cluster
from tests.made_store import store_bytes

pytest.importorskip("distributed")

SCENE = """
conditions = ["knee.2 overlaps foot.2"]
[progressions.knee]
of = "right knee bent"
steps = "0 1 0"
[progressions.foot]
of = "right foot raised"
steps = "0 1 0"
"""


@pytest.fixture(scope="module")
def clips(fixtures_dir):
    return fixtures_dir / "clips"


@pytest.fixture(scope="module")
def store(clips, tmp_path_factory):
    """A store of several segment files, so that there is something to be spread."""
    store = tmp_path_factory.mktemp("stores") / "several.store"
    for part in sorted(path for path in clips.iterdir() if path.is_dir()):
        index_files([part], store, IndexOptions(root=clips))
    return store


@pytest.fixture(scope="module")
def templates(store, tmp_path_factory, mocapidx):
    path = tmp_path_factory.mktemp("templates") / "learned.h5"
    classes = ("--class", "squat", "--class", "walk", "--class", "kickFrontRight")
    done = mocapidx("learn-mt", store, "--labels-from", "folder", *classes, "--output", path)
    assert done.returncode == 0, done.stderr
    return path


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Three worker processes, shared by all commands here."""
    with made_cluster(tmp_path_factory.mktemp("cluster"), 3) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def everywhere(cluster, mocapidx, tmp_path_factory):
    """Run a command serially, with two processes where it can, and on the cluster.

    Gives what each of them printed, on both streams, and what it wrote.
    """

    def run(*arguments, output=None, jobs=True):
        ways = [("--jobs", 1), ("--jobs", 2)] if jobs else [()]
        results = []
        for number, way in enumerate([*ways, ("--scheduler", cluster.address)]):
            place = tmp_path_factory.mktemp("out") / "result"
            where = () if output is None else (output, place)
            done = mocapidx(*arguments, *where, *way, cwd=place.parent)
            assert done.returncode == 0, (number, done.stderr)
            wrote = store_bytes(place) if place.is_dir() else None
            wrote = place.read_bytes() if place.is_file() else wrote
            results.append((done.stdout, done.stderr.split("; ")[0], wrote))
        return results

    return run


def assert_alike(results):
    for result in results[1:]:
        assert result[0] == results[0][0]
        assert result[2] == results[0][2]


def test_index(everywhere, clips):
    results = everywhere("index", clips, "--quiet", output="--store")
    assert_alike(results)
    assert len(results) == 3
    assert results[0][2]


def test_learn_mt(everywhere, store):
    classes = ("--class", "squat", "--class", "walk", "--class", "jog", "--quiet")
    results = everywhere("learn-mt", store, "--labels-from", "folder", *classes, output="--output")
    assert_alike(results)
    assert results[0][2]


@pytest.mark.parametrize("method", ["path", "hits"])
def test_annotate(everywhere, store, clips, templates, method):
    rows = ("--method", method, "--format", "jsonl")
    of_store = everywhere("annotate", store, "--templates", templates, *rows)
    assert_alike(of_store)
    assert of_store[0][0].count("\n") > 5
    if method == "path":
        files = (clips / "squat", clips / "walk")
        assert_alike(everywhere("annotate", *files, "--templates", templates, *rows))


def test_retrieve(everywhere, store, templates):
    results = everywhere(
        *("retrieve", store, "--templates", templates, "--class", "kickFrontRight"),
        *("--tau", "0.3", "--format", "jsonl"),
        output="--profile",
        jobs=False,
    )
    assert_alike(results)
    assert results[0][0].count("\n") > 5
    assert results[0][2]


@pytest.mark.parametrize(
    "question",
    [
        ("--steps-of", "F20", "0 1 0", "--mirror"),
        ("--scene", "{scene}", "--mirror", "--explain"),
        ("--example", "{clip}", "--select", "F17,F20", "--rank", "dtw"),
        ("--example", "{clip}", "--select", "auto", "--explain"),
    ],
    ids=["pattern", "scene", "example", "auto"],
)
def test_query(everywhere, store, clips, question, tmp_path):
    clip = sorted(clips.glob("kickFrontRight/*.amc"))[0]
    (tmp_path / "scene.toml").write_text(SCENE)
    question = [part.format(clip=clip, scene=tmp_path / "scene.toml") for part in question]
    results = everywhere("query", store, *question, "--format", "jsonl", jobs=False)
    assert_alike(results)
    assert results[0][1] == results[1][1]
    assert results[0][0]


def test_web_build(everywhere, store):
    some = ("--where", "document = walk*")
    results = everywhere("web", "build", store, *some, "--quiet", output="--output")
    assert_alike(results)
    assert results[0][2]
