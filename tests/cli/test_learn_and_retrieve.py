import csv
import io
import json

import pytest

from tests.made_words import make_word_store, rest
from tests.tasks.test_learn import clips

ROWS = ("raise", "kick", "bow")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli")
    documents = clips()
    make_word_store(folder / "s.store", documents)
    rows = "".join(f"{name},{name.split('/')[0]},{name[-6]}\n" for name in documents)
    (folder / "labels.csv").write_text(f"document,label,group\n{rows}")
    return folder


@pytest.fixture(scope="module")
def learned(folder, mocapidx):
    return mocapidx(
        "learn-mt", folder / "s.store", "--labels", folder / "labels.csv",
        "--output", folder / "t.h5", "--jobs", "1",
    )  # fmt: skip


def test_learning_writes_the_templates_and_tells_about_each_class(learned, folder):
    assert learned.returncode == 0, learned.stderr
    assert learned.stdout == ""
    for name in ROWS:
        assert f"{name}: 4 examples" in learned.stderr
    assert f"{folder / 't.h5'}: 3 templates" in learned.stderr


def test_learning_again_gives_the_same_bytes_in_any_number_of_processes(learned, folder, mocapidx):
    done = mocapidx(
        "learn-mt", folder / "s.store", "--labels-from", r"(?P<label>\w+)/(?P<group>\w)",
        "--output", folder / "again.h5", "--jobs", "2", "--quiet",
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (folder / "again.h5").read_bytes() == (folder / "t.h5").read_bytes()


@pytest.mark.parametrize("steps", ["weighted", "printed"])
def test_hits_are_records_in_their_order(learned, folder, mocapidx, steps):
    done = mocapidx(
        "retrieve", folder / "s.store", "--templates", folder / "t.h5", "--class", "kick",
        "--steps", steps, "--format", "jsonl", "--quiet",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    hits = [json.loads(line) for line in done.stdout.splitlines()]
    assert [hit["rank"] for hit in hits] == list(range(1, len(hits) + 1))
    assert {hit["document"] for hit in hits} >= {f"kick/{'ab'[n % 2]}{n}.amc" for n in range(4)}
    assert list(hits[0])[:4] == ["rank", "document", "start_frame", "end_frame"]
    assert hits == sorted(hits, key=lambda hit: (hit["cost"], hit["document"]))


def test_a_preselection_says_that_it_can_lose_hits(learned, folder, mocapidx):
    done = mocapidx(
        "retrieve", folder / "s.store", "--templates", folder / "t.h5", "--class", "kick",
        "--keyframes", "auto", "--format", "csv", "--output", folder / "hits.csv",
    )  # fmt: skip
    assert done.returncode == 0
    assert "can lose hits" in done.stderr
    rows = list(csv.DictReader(io.StringIO((folder / "hits.csv").read_text())))
    assert len(rows) == 4


@pytest.mark.parametrize(
    ("arguments", "code", "complaint"),
    [
        (["--class", "jump"], 2, "no template of a class 'jump'; there are: bow, kick, raise"),
        (["--class", "kick", "--tau", "0"], 2, "--tau"),
        (["--class", "kick", "--keyframes", "all"], 2, "none, auto or columns"),
        (["--class", "kick", "--keyframes", "5000"], 2, "keyframes must be"),
        ([], 2, "--class"),
    ],
)
def test_wrong_usage_is_one_line(learned, folder, mocapidx, arguments, code, complaint):
    done = mocapidx("retrieve", folder / "s.store", "--templates", folder / "t.h5", *arguments)
    assert done.returncode == code
    assert complaint in done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


def test_a_damaged_or_missing_template_file_is_exit_4(learned, folder, mocapidx):
    data = bytearray((folder / "t.h5").read_bytes())
    data[len(data) // 2] ^= 1
    (folder / "damaged.h5").write_bytes(data)
    for name, complaint in (("damaged.h5", "digest"), ("none.h5", "no template file here")):
        done = mocapidx(
            "retrieve", folder / "s.store", "--templates", folder / name, "--class", "kick"
        )
        assert done.returncode == 4
        assert complaint in done.stderr
        assert done.stderr.count("\n") == 1


def test_a_store_of_another_rate_is_exit_4(learned, folder, mocapidx, tmp_path):
    store = make_word_store(tmp_path / "s.store", {"x.amc": rest(9)}, rate=60.0)
    done = mocapidx("retrieve", store, "--templates", folder / "t.h5", "--class", "kick")
    assert done.returncode == 4
    assert "60 frames/s" in done.stderr


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("kick/a0.amc,", "labels.csv:2: the label is empty"),
        ("kick/none.amc,kick", "labels.csv:2: no document 'kick/none.amc'"),
    ],
)
def test_a_bad_row_is_exit_3_with_its_line(folder, mocapidx, tmp_path, row, complaint):
    (tmp_path / "labels.csv").write_text(f"document,label\n{row}\n")
    done = mocapidx(
        "learn-mt", folder / "s.store", "--labels", tmp_path / "labels.csv",
        "--output", tmp_path / "t.h5",
    )  # fmt: skip
    assert done.returncode == 3
    assert complaint in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "t.h5").exists()


def test_templates_that_cannot_be_written_are_told_before_anything_is_lost(folder, mocapidx):
    done = mocapidx(
        "learn-mt", folder / "s.store", "--labels", folder / "labels.csv",
        "--output", folder / "none" / "t.h5", "--jobs", "1",
    )  # fmt: skip
    assert done.returncode == 2
    assert "there is no folder" in done.stderr
