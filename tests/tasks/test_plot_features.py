import pytest
from PIL import Image

from mocapidx.errors import ParameterError
from mocapidx.tasks.plot import draw_confusion
from mocapidx.tasks.plot_features import draw_feature_matrix, draw_list_sizes

CLIP = "clips/walk/ann_walk_001_120.amc"


def test_a_file_and_its_document_look_alike(fixtures_dir, fixtures_store, tmp_path):
    draw_feature_matrix(fixtures_dir / CLIP, tmp_path / "file.png")
    draw_feature_matrix(fixtures_store, tmp_path / "store.png", document=CLIP)
    file, stored = (Image.open(tmp_path / name) for name in ("file.png", "store.png"))
    assert file.size == stored.size
    below_title = (0, 60, *file.size)
    assert file.crop(below_title).tobytes() == stored.crop(below_title).tobytes()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({}, "holds several documents; choose with --document"),
        ({"document": "none"}, "no document 'none'"),
        ({"document": CLIP, "start": 900.0}, "nothing of it lies between --start and --end"),
        ({"document": CLIP, "end": 0.001}, "nothing of it lies between --start and --end"),
    ],
)
def test_what_can_not_be_drawn_is_told(fixtures_store, tmp_path, options, says):
    with pytest.raises(ParameterError, match=says):
        draw_feature_matrix(fixtures_store, tmp_path / "a.png", **options)
    with pytest.raises(ParameterError, match=r"\.png or \.svg"):
        draw_feature_matrix(fixtures_store, tmp_path / "a.gif", document=CLIP)
    assert list(tmp_path.iterdir()) == []


def test_the_lists_of_a_store_are_drawn(fixtures_store, tmp_path):
    draw_list_sizes(fixtures_store, tmp_path / "lists.svg")
    assert (tmp_path / "lists.svg").stat().st_size > 5000


def test_annotations_have_a_confusion_table_and_hits_have_none(tmp_path):
    said = '{"document": "a", "start_time": 0, "end_time": 2, "cost": 0, "label": "walk"}\n'
    (tmp_path / "said.jsonl").write_text(said)
    (tmp_path / "hits.jsonl").write_text(said.replace("{", '{"rank": 1, ', 1))
    labels = tmp_path / "labels.csv"
    labels.write_text("document,label,start_time,end_time\na,run,0,1\na,walk,1,2\n")
    draw_confusion(tmp_path / "said.jsonl", labels, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ParameterError, match="hits have no confusion table"):
        draw_confusion(tmp_path / "hits.jsonl", labels, tmp_path / "b.png")
