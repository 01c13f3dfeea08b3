"""Sound files of every kind that mocapidx reads, small, made from generated motion."""

import json
import re
import shutil
from importlib.resources import files

import numpy as np

from mocapidx.graphs.graph_text import graph_to_graphml, graph_to_json
from mocapidx.graphs.match_graph import MatchEdge, MatchGraph, MatchNode
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.store.sigma import MeasuredSigma, save_sigma
from mocapidx.synthesis.file import save_space
from mocapidx.tasks.blend import FitOptions, fit_blend_space
from mocapidx.tasks.blend_examples import ExampleOptions
from mocapidx.tasks.index import index_files
from mocapidx.tasks.read import read_motion
from mocapidx.tasks.web import build_web
from mocapidx.templates.file import save_templates
from mocapidx.templates.template import MotionTemplate, TemplateSet
from mocapidx.transcripts.babel import babel_text
from mocapidx.transcripts.kinds import KINDS
from mocapidx.transcripts.spans import Span, Transcript
from tests.made_points import c3d_bytes, markers_of, trc_text
from tests.made_webs import add_motions, gestures
from tests.small_files import AMC, ASF, BVH, PERSON, bvh_text, person_rows

FRAMES = 16
LONGER = 72
PATTERN = """
name = "three squats"
steps = [
    "not right knee bent, not left knee bent",
    { times = 3, steps = [
        { is = "right knee bent, left knee bent", min = 0.3 },
        { is = "not right knee bent", max = 2 },
    ] },
    "*",
    "F37",
]
"""
DESIGN = """
[[template]]
from = "squat"
as = "squat with any arms"
delta = 0.2
tau = 0.08
keyframes = [4, 1]
keyframe_tolerance = 2

[[template.set]]
features = "upper"
value = "undecided"

[[template.set]]
features = "F1"
frames = [0, 3]
value = 0

[[template]]
class = "sweep"
frames = 50

[[template.set]]
features = "F13,F32,F33"
seconds = [0.1, 0.2]
value = 1
"""
PARAMETERS = """
name = "foot"

[[parameter]]
joint = "rankle"
axes = "xy"
when = { max = "height", joint = "rankle" }

[[parameter]]
what = "distance"
joint = "rhip"
from = "lhip"
when = 0.75
scale = 0.1

[[parameter]]
what = "facing"
when = "mean"
"""
SETTINGS = """
[all]
jobs = 2
quiet = true

[index]
rate = 30.0
skeleton = "a/b.asf"

[template.show]
format = "jsonl"
"""
KICK = """
[[parameter]]
joint = "rankle"
axes = "y"
when = { max = "height", joint = "rankle" }
"""


def make_seeds(folder, fixtures):
    """Write all seeds: ``folder/KIND/*``, with what has to stand beside them in ``KIND.beside/``.

    `fixtures` is a folder of generated motion.
    """
    clip = fixtures / "clips/kickFrontRight/ann_kickFrontRight_001_120.amc"
    if not clip.exists():
        clip = sorted(fixtures.glob("clips/kickFrontRight/*.amc"))[0]
    make_motion_files(folder, fixtures, clip)
    make_store_files(folder, fixtures, clip)
    make_texts(folder)


def put(folder, kind, name, data):
    path = folder / kind / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def make_motion_files(folder, fixtures, clip):
    skeleton = sorted(clip.parents[1].glob("*.asf"))[0]
    frames = re.split(r"(?m)^(?=\d+\n)", clip.read_text())
    short = "".join(frames[: FRAMES + 1])
    put(folder, "amc", "clip.amc", short)
    put(folder, "amc.beside", skeleton.name, skeleton.read_bytes())
    put(folder, "asf", "clip.asf", skeleton.read_bytes())
    put(folder, "asf.beside", "take.amc", "".join(frames[:5]))
    put(folder, "amc-small", "take.amc", AMC)
    put(folder, "amc-small.beside", "small.asf", ASF)
    put(folder, "asf-small", "small.asf", ASF)
    put(folder, "asf-small.beside", "take.amc", AMC)
    head, _, rows = sorted(fixtures.glob("bvh/*/*.bvh"))[0].read_text().partition("Frame Time")
    rows = "\n".join(rows.split("\n")[: FRAMES + 1]) + "\n"
    put(
        folder,
        "bvh",
        "clip.bvh",
        re.sub(r"Frames: \d+", f"Frames: {FRAMES}", head) + "Frame Time" + rows,
    )
    put(folder, "bvh", "small.bvh", BVH)
    put(folder, "bvh", "person.bvh", bvh_text(PERSON, person_rows(4, LeftArm=(1e-3, 20, 0))))

    motion = read_motion(clip)
    positions = motion.positions[:FRAMES]
    seen = positions.copy()
    seen[3:5, 9] = np.nan
    markers, places = markers_of(CANONICAL_JOINTS, seen)
    for processor, real in (("Intel", True), ("DEC", True), ("SGI", False)):
        data = c3d_bytes(markers, places * 1000, 60.0, processor=processor, real=real, up="+Y")
        put(folder, "c3d", f"{processor}.c3d", data)
    put(folder, "trc", "points.trc", trc_text(markers, places * 1000, 60.0))
    put(folder, "trc", "joints.trc", trc_text(CANONICAL_JOINTS, seen, 60.0, "m"))
    columns = [f"{joint}.{axis}" for joint in CANONICAL_JOINTS for axis in "xyz"]
    wide = [["time", *columns]]
    wide += [[f"{n / 60:.6f}", *map(cell, row.ravel())] for n, row in enumerate(seen)]
    put(folder, "csv", "wide.csv", "\n".join(map(",".join, wide)) + "\n")
    long = [["frame", "joint", "x", "y", "z"]]
    for n, row in enumerate(seen[:6]):
        long += [
            [str(n), joint, *map(cell, place)]
            for joint, place in zip(CANONICAL_JOINTS, row, strict=True)
        ]
    put(folder, "csv", "long.csv", "\n".join(map(",".join, long)) + "\n")
    make_keypoints(folder, seen)

    random = np.random.default_rng(1)
    place = folder / "npz"
    place.mkdir()
    np.savez(
        place / "amass.npz", poses=random.normal(0, 0.2, (8, 156)), trans=np.zeros((8, 3)),
        betas=np.zeros(16), mocap_framerate=60.0, gender=np.array("neutral"),
    )  # fmt: skip
    np.savez(
        place / "points.npz", positions=seen.astype("f4"), joints=np.array(CANONICAL_JOINTS),
        rate=60.0, unit=1.0, up=np.array("y"), made=np.array(["headtop"]),
    )  # fmt: skip
    (folder / "npy").mkdir()
    np.save(folder / "npy/points.npy", positions.astype("f4"))
    np.save(folder / "npy/fortran.npy", np.asfortranarray(positions))
    put(folder, "npy.beside", "joints.txt", "\n".join(CANONICAL_JOINTS))
    put(folder, "joints", "joints.txt", "\n".join(CANONICAL_JOINTS))
    put(folder, "joints.beside", "take.npy", (folder / "npy/points.npy").read_bytes())


def cell(value):
    return "" if np.isnan(value) else f"{value:.5f}"


def make_keypoints(folder, seen):
    points = np.round(np.nan_to_num(seen[:6]), 4).tolist()
    named = {"joints": list(CANONICAL_JOINTS), "rate": 60, "frames": points}
    put(folder, "json", "named.json", json.dumps(named))
    coco = [[[*place, 0.9] for place in frame[:17]] for frame in points]
    put(folder, "json", "coco.json", json.dumps([{"keypoints": frame} for frame in coco]))
    flat = [[value for place in frame for value in place] for frame in coco]
    people = [{"people": [{"pose_keypoints_3d": frame}]} for frame in flat]
    put(folder, "json", "people.json", json.dumps(people))


def make_store_files(folder, fixtures, clip):
    sources = folder / "sources"
    small = put(folder, "sources", clip.name, (folder / "amc/clip.amc").read_bytes())
    skeleton = next((folder / "amc.beside").iterdir())
    shutil.copy(skeleton, sources)
    store = folder / "take.store"
    index_files([sources], store)
    put(folder, "sources", "second.amc", small.read_bytes().replace(b"root ", b"root  ", 1))
    shutil.copy(folder / "bvh/clip.bvh", sources)
    index_files([sources], store)
    text = load_text("mocapidx.features", "sets/f39.toml")
    with_sigma = MeasuredSigma(tuple([0.1] * 38 + [float("nan")]), feature_digest(), 24)
    assert save_sigma(store, with_sigma)
    for kind in ("manifest", "sigma", "h5", "idx", "forged-manifest", "forged-sigma"):
        shutil.copytree(store, folder / f"{kind}.beside/take.store")
    for kind in ("manifest", "forged-manifest"):
        put(folder, kind, "MANIFEST", (store / "MANIFEST").read_bytes())
    for kind in ("sigma", "forged-sigma"):
        put(folder, kind, "SIGMA", (store / "SIGMA").read_bytes())
    for kind in ("h5", "idx"):
        put(folder, kind, f"1.{kind}", (store / f"segments/000001.{kind}").read_bytes())
    for kind in ("forged-idx", "forged-h5", "flips"):
        shutil.copytree(store, folder / f"{kind}.beside/take.store")
        put(folder, kind, "nothing", b"")
    make_used_store(folder, clip)

    random = np.random.default_rng(0)
    digest = feature_digest()
    full = MotionTemplate(
        "squat", random.integers(0, 2, (5, 39)).astype(float), digest, 30.0, delta=0.2,
        mean_length=4.5, passes=3, documents=("a/x.amc", "b.bvh@1:2.5"), spread=(0.1, 0.2),
        keyframes=(1, 4), keyframe_tolerance=2, positive_cost=0.5, background_cost=0.25, tau=0.1,
        kind="stretch", looping=True,
    )  # fmt: skip
    plain = MotionTemplate("plain", np.zeros((1, 39)), digest, 30.0)
    whole = TemplateSet((full, plain), "f39", digest, text, 30.0)
    arms = add_motions(folder / "arms.store", gestures(2))
    kicks = sorted(fixtures.glob("clips/kickFrontRight/*.amc"))[:2]
    hits = [
        {"document": path.name, "start_time": 0, "end_time": 0.6, "label": "kick"} for path in kicks
    ]
    records = put(folder, "work", "hits.jsonl", "\n".join(map(json.dumps, hits)) + "\n")
    kick = put(folder, "work", "kick.toml", KICK)
    for kind in ("templates", "forged-templates"):
        (folder / kind).mkdir()
        save_templates(folder / kind / "t.mt", whole)
    save_templates(folder / "forged-used.beside/t.mt", whole)
    build_web(arms, folder / "work/arms.web", map_fn=map)
    options = ExampleOptions(roots=(kicks[0].parent,))
    space = fit_blend_space(records, str(kick), examples=options, options=FitOptions(draws=10))
    for kind in ("web", "forged-web"):
        put(folder, kind, "arms.web", (folder / "work/arms.web").read_bytes())
        shutil.copytree(arms, folder / f"{kind}.beside/arms.store")
    for kind in ("space", "forged-space"):
        (folder / kind).mkdir()
        save_space(space, folder / kind / "kick.space")


def make_used_store(folder, clip):
    """Make a store of four kicks in two segment files, long enough for every command."""
    sources, store = folder / "kicks", folder / "forged-used.beside/take.store"
    shutil.copytree(folder / "amc.beside", sources)
    store.parent.mkdir()
    for number, kick in enumerate(sorted(clip.parent.glob("*.amc"))[:4]):
        frames = re.split(r"(?m)^(?=\d+\n)", kick.read_text())
        put(folder, "kicks", kick.name, "".join(frames[: LONGER + 1]))
        if number % 2:
            index_files([sources], store)
    put(folder, "forged-used", "nothing", b"")


def feature_digest():
    from mocapidx.features.featureset import load_feature_set

    return load_feature_set("f39").digest


def load_text(package, name):
    return (files(package) / name).read_text(encoding="utf-8")


def make_texts(folder):
    graph = MatchGraph(
        10.0, 0.12,
        (
            MatchNode("arm0.bvh", 3, 16, 0, None, 0.0),
            MatchNode("arm1.bvh", 4, 17, 1, 0.05, 0.05),
            MatchNode("b \\udc80.bvh", 0, 12, 2, None, 0.1),
        ),
        (
            MatchEdge(0, 1, 0.05, np.array([[n, n] for n in range(13)])),
            MatchEdge(1, 2, 0.05, np.array([[n, min(n, 11)] for n in range(13)])),
        ),
    )  # fmt: skip
    put(folder, "graph-json", "g.json", graph_to_json(graph))
    put(folder, "graphml", "g.graphml", graph_to_graphml(graph))

    spans = (Span(0.1, 1.5, "walk"), Span(1.5, 2.0, "kick"), Span(1.8, 2.5, "punch & <b>"))
    transcript = Transcript("takes/a.bvh", spans, 3.0)
    for name, kind in KINDS.items():
        data = babel_text([transcript]) if name == "babel" else kind.write(transcript)
        put(folder, name, f"a{kind.suffix}", data)
    rows = [
        {"rank": n, "document": f"d{n}.amc", "start_frame": 3, "end_frame": 9, "start_time": 0.1,
         "end_time": 0.3, "source_start_frame": 12, "source_end_frame": 36, "cost": 0.1 * n,
         "label": "walk"}
        for n in range(1, 4)
    ]  # fmt: skip
    put(folder, "records-jsonl", "r.jsonl", "\n".join(map(json.dumps, rows)) + "\n")
    lines = [",".join(rows[0]), *(",".join(map(str, row.values())) for row in rows)]
    put(folder, "records-csv", "r.csv", "\n".join(lines) + "\n")
    labels = "document,label,start_time,end_time,group\na.amc,walk,0.5,1.5,ann\nb.amc,jog,,,bob\n"
    put(folder, "labels", "l.csv", labels)

    for name in ("f39", "f31"):
        put(
            folder,
            "feature-set",
            f"{name}.toml",
            load_text("mocapidx.features", f"sets/{name}.toml"),
        )
    maps = files("mocapidx.skeleton") / "maps"
    for name in ("smpl", "mixamo", "humanik-one-spine"):
        put(folder, "joint-map", f"{name}.toml", (maps / f"{name}.toml").read_text())
    for name in ("body-25", "plug-in-gait", "irsst-upper-body"):
        put(folder, "marker-map", f"{name}.toml", (maps / f"markers/{name}.toml").read_text())
    put(folder, "pattern", "p.toml", PATTERN)
    put(folder, "scene", "s.toml", load_text("mocapidx.queries", "scenes/kick-then-punch.toml"))
    put(folder, "design", "d.toml", DESIGN)
    put(folder, "parameters", "p.toml", PARAMETERS)
    put(folder, "settings", "mocapidx.toml", SETTINGS)
