"""Every kind of file that is attacked: where it lies, how it is damaged, what reads it."""

import contextlib
import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from mocapidx.errors import MocapidxError, StoreError
from mocapidx.formats.registry import read_recording, sources_of
from mocapidx.formats.slice_c3d import c3d_frames
from mocapidx.formats.slice_text import amc_frames, bvh_frames
from mocapidx.formats.text import Limits
from mocapidx.index.postings import open_index
from mocapidx.store import closed, verify
from mocapidx.store.read import open_store
from mocapidx.store.sigma import read_sigma, sigma_fault
from mocapidx.store.web import read_web
from mocapidx.synthesis.file import load_space
from mocapidx.tasks import segment_sources
from mocapidx.tasks import verify as verify_task
from mocapidx.tasks.blend import (
    aim_records,
    example_records,
    made_summary,
    make_motion,
    space_facts,
)
from mocapidx.tasks.doctor import examination_lines, examination_record, examine_file
from mocapidx.tasks.info import document_info, list_documents, store_info
from mocapidx.tasks.match import MatchOptions, match_records, match_store
from mocapidx.tasks.query import query_store
from mocapidx.tasks.template import edit_templates, template_features, template_records
from mocapidx.tasks.template_records import draw_text
from mocapidx.tasks.verify import verify_store
from mocapidx.tasks.web import build_web, web_info
from mocapidx.templates.file import load_templates
from tests.fuzz import forging
from tests.fuzz.mutants import damaged, damaged_json
from tests.fuzz.text_readers import (
    design,
    feature_set,
    graph,
    joint_map,
    labels,
    marker_map,
    parameters,
    pattern,
    records,
    scene,
    settings,
    spoken,
)
from tests.fuzz.using import forge_anything, use

__all__ = ["TARGETS", "Target", "without_waiting"]


@dataclass(frozen=True)
class Target:
    """A kind of file.

    `place` is where it lies in a folder of work; `read` gives an answer as text; `mutant` makes
    bytes of a seed, all seeds and a generator of random numbers, or `attack` changes the folder at
    the place by itself and knows the number of the mutant. Of what is `sealed` an answer must be
    that of the whole file. In a short run so many mutants are read, in a full one `full` of them,
    or as many as there are bits.
    """

    name: str
    place: str
    read: Callable[[Path], str]
    mutant: Callable = damaged
    attack: Callable | None = None
    sealed: bool = False
    short: int = 500
    full: int = 10_000


def motion(path):
    """All that is done to a motion file before it is in a store, and the lines of the doctor."""
    take = path if path.suffix not in (".asf", ".txt") else next(path.parent.glob("take.*"))
    recording = read_recording(take, skeleton_path=(*sources_of(take), None)[1])
    examination = examine_file(take)
    lines = list(examination_lines(examination))
    lines += map(str, examination_record(examination).values())
    assert all(line.isprintable() for line in lines), lines
    frames = {".bvh": bvh_frames, ".amc": amc_frames, ".c3d": c3d_frames}.get(take.suffix)
    if frames is not None:
        frames(take, Limits())
    return f"{type(recording).__name__}\n" + "\n".join(lines)


def schemas_here(path, files):
    """What a child of `verify` does, in this process, which has limits of its own."""
    for file in files:
        known = {name: (each.shape, each.offset) for name, each in file.datasets.items()}
        what = closed.check_closed(path / "segments" / file.names[0], known)
        if what is not None:
            yield verify.Problem(file.number, file.names[0], what)


def without_waiting():
    """Spare `verify` its child and queries the reading of the same feature set, over and over."""
    verify_task.check_schemas = schemas_here
    segment_sources.parse_feature_set = lru_cache(segment_sources.parse_feature_set)


def store(path):
    """Verify a store and ask it everything; damage that `verify` misses must change nothing."""
    while path.suffix != ".store":
        path = path.parent
    try:
        problems = verify_store(path).problems
        assert all(line.isprintable() for line in problems), problems
    except StoreError as exc:
        problems = (str(exc),)
    try:
        answer = asked(path)
    except MocapidxError as exc:
        if not problems:
            raise AssertionError(f"verify finds nothing, but: {exc}") from exc
        raise
    if problems:
        # What verify finds may be what no answer needs.
        return f"found\n{answer}"
    return f"sound\n{answer}"


def asked(path):
    """Ask a store for what its files hold."""
    digest = hashlib.blake2b()
    with open_store(path) as snapshot:
        names = [placed.document.name for placed in snapshot.documents()]
        for file in snapshot.files:
            for name in sorted(file.datasets):
                digest.update(snapshot.array(file, name).tobytes())
            lists = open_index(
                snapshot.index_head(file),
                lambda at, size, file=file: snapshot.index_bytes(file, at, size),
                file.idx.size,
            )
            for part in lists.values():
                for each in part.lists(range(len(part.words))):
                    digest.update(np.array(each, dtype="<u4").tobytes())
    found = query_store(path, steps_of=("F20", "0")).hits
    rows = [f"{hit.document} {hit.start_frame} {hit.end_frame} {hit.cost}" for hit in found]
    facts = [str(store_info(path)), *(str(document_info(path, name)) for name in names[:1])]
    facts.append(str(list_documents(path)))
    return "\n".join([*sorted(names), digest.hexdigest(), *sorted(rows), *facts])


def quick_store(path):
    """Ask a store as a user does; for stores whose every digest is right."""
    while path.suffix != ".store":
        path = path.parent
    with contextlib.suppress(MocapidxError):
        verify_store_here(path)
    answer = asked(path)
    with contextlib.suppress(MocapidxError):
        for row in list_documents(path)[:1]:
            for mode in ("exact", "fuzzy", "adaptive"):
                query_store(path, row["document"], mode=mode)
            query_store(path, row["document"], rank="dtw")
    return answer


def verify_store_here(path):
    problems = verify_store(path).problems
    assert all(line.isprintable() for line in problems), problems


def sigma(path):
    fault = sigma_fault(path.parent)
    if fault is not None:
        assert fault.isprintable(), fault
        raise StoreError(fault)
    return repr(read_sigma(path.parent))


def templates(path):
    found = load_templates(path)
    feature_set = template_features(found)
    facts = [str(row) for row in template_records(path)]
    for template in found.templates:
        facts += draw_text(template, feature_set)
        facts.append(template.matrix.tobytes().hex())
    design = path.with_name("design.toml")
    if not design.exists():
        design.write_text('[[template]]\nfrom = "squat"\nas = "squat 2"\n')
    with contextlib.suppress(MocapidxError):
        edit_templates(path, design, path.with_name("new.mt"))
    return "\n".join([found.feature_set_text, *facts])


def web(path):
    found = read_web(path)
    facts = str(web_info(path))
    assert facts.isprintable(), facts
    graph = match_store(
        path.parent / "arms.store", path, "arm0.bvh@0.3:1.6", MatchOptions(epsilon=0.12)
    )
    rows = [str(record) for record in match_records(graph)]
    return "\n".join([str(found.rules), hashlib.md5(found.paths).hexdigest(), *rows])


def forged_web(path):
    """Bring a web up to date that holds what its digests say."""
    copy = path.with_name("copy.web")
    copy.write_bytes(path.read_bytes())
    with contextlib.suppress(MocapidxError):
        build_web(path.parent / "arms.store", copy, map_fn=map)
    return web(path)


def space(path):
    found = load_space(path)
    facts = [*space_facts(found), *map(str, example_records(found))]
    assert all(line.isprintable() for line in facts), facts
    target = found.parameters[0]
    made = make_motion(found, target, rate=30)
    facts += [made_summary(made), *map(str, aim_records(made))]
    assert all(line.isprintable() for line in facts), facts
    answer = [made.motion.positions.tobytes(), found.weights.tobytes(), found.text.encode()]
    return hashlib.md5(b"".join(answer)).hexdigest()


TARGETS = {
    target.name: target
    for target in (
        Target("bvh", "take.bvh", motion),
        Target("amc", "take.amc", motion),
        Target("asf", "clip.asf", motion),
        Target("amc-small", "take.amc", motion),
        Target("asf-small", "small.asf", motion),
        Target("c3d", "take.c3d", motion),
        Target("npz", "take.npz", motion, forging.forged_archive),
        Target("npy", "take.npy", motion),
        Target("joints", "joints.txt", motion),
        Target("trc", "take.trc", motion),
        Target("csv", "take.csv", motion),
        Target("json", "take.json", motion, damaged_json),
        Target("manifest", "take.store/MANIFEST", store, sealed=True),
        Target("h5", "take.store/segments/000001.h5", store, sealed=True),
        Target("idx", "take.store/segments/000001.idx", store, sealed=True, full=100_000),
        Target(
            "flips", "take.store", store, attack=forging.flip_bit, sealed=True, short=1500, full=0
        ),
        Target("sigma", "take.store/SIGMA", sigma, sealed=True),
        Target("templates", "t.mt", templates, sealed=True),
        Target("web", "arms.web", web, sealed=True),
        Target("space", "kick.space", space, sealed=True),
        Target(
            "forged-manifest", "take.store/MANIFEST", quick_store, forging.forged_lines, short=200
        ),
        Target("forged-h5", "take.store", quick_store, attack=forging.forge_arrays, short=200),
        Target("forged-idx", "take.store", quick_store, attack=forging.forge_index, short=200),
        Target("forged-used", "take.store", use, attack=forge_anything, short=20, full=2000),
        Target("forged-sigma", "take.store/SIGMA", sigma, forging.forged_lines),
        Target("forged-templates", "t.mt", templates, forging.forged_seal),
        Target("forged-web", "arms.web", forged_web, forging.forged_seal, short=200),
        Target("forged-space", "kick.space", space, forging.forged_seal),
        Target("graph-json", "g.json", graph, damaged_json),
        Target("graphml", "g.graphml", graph),
        Target("labels", "l.csv", labels),
        Target("records-jsonl", "r.jsonl", spoken, damaged_json),
        Target("records-csv", "r.csv", records),
        Target("eaf", "a.eaf", spoken),
        Target("textgrid", "a.TextGrid", spoken),
        Target("vtt", "a.vtt", spoken),
        Target("srt", "a.srt", spoken),
        Target("babel", "a.json", spoken, damaged_json),
        Target("feature-set", "f.toml", feature_set),
        Target("joint-map", "m.toml", joint_map),
        Target("marker-map", "m.toml", marker_map),
        Target("pattern", "p.toml", pattern),
        Target("scene", "s.toml", scene),
        Target("design", "d.toml", design),
        Target("parameters", "p.toml", parameters),
        Target("settings", "mocapidx.toml", settings),
    )
}
