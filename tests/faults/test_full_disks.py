"""Every command on a full disk, a closed one, and with a limit for the size of files."""

import hashlib
import itertools
import os
import re
import shutil

import pytest

from tests.faults.cramped import Cramped
from tests.faults.faulting import stores_of, tree_of
from tests.faults.places import Places, change_modes
from tests.faults.world import WRITERS

EFFORTLESS = ("compact-one", "measure")
"""Have nothing to write, or nothing that they can't do without."""

NO_INPUTS = ("compact-", "repair-", "man", "remove")
"""Read nothing but what they write."""

READERS = (
    "query one.store --example squat/1.bvh",
    "query one.store --example squat/1.bvh --select auto",
    "query one.store --example squat/1.bvh --output ../../elsewhere/hits.csv --format csv",
    "retrieve one.store --templates t.mt --class squat",
    "annotate one.store --templates t.mt",
    "match arms.store --web arms.web --query arm0.bvh",
    "info one.store",
    "info many.store --documents",
    "verify one.store",
    "web info arms.web",
    "template show t.mt --class squat",
    "blend info squat.space",
    "evaluate squats.jsonl --truth labels.csv",
    "skeleton takes/squat/1.bvh",
    "doctor takes",
    "align takes/squat/1.bvh more/squat/2.bvh",
    "plot matrix one.store --document squat/1.bvh --output ../../elsewhere/m.png",
    "report one.store squats.jsonl --output ../../elsewhere/r.html",
    "export squats.jsonl --root takes --output ../../elsewhere/clips",
    "learn-mt one.store --labels-from folder --output ../../elsewhere/t.mt",
    "index takes --store ../../elsewhere/new.store --jobs 1",
    "merge one.store other.store --output ../../elsewhere/new.store",
    "reindex one.store --store ../../elsewhere/new.store --feature-set f31",
)
"""Read from the world, and write elsewhere if at all."""

CLOSED = re.compile(
    r"Error: \S+: may not be written"
    r"(; see to its permissions or its file system| \(.+\); nothing was made)\n"
)
NO_FOLDER = re.compile(r"Error: none/\S+: there is no folder none; make it first\n")
NOBODY = 65534
NOTHING = hashlib.blake2b(b"").hexdigest()
NO_OUTPUT = "Error: could not write to the standard output: no space left on device"


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    found = Places(tmp_path_factory.mktemp("places"))
    yield found
    found.close()


@pytest.fixture
def small_disk(places):
    if not places.has_disk:
        pytest.skip("mounting a small disk is not allowed here")
    return places


@pytest.fixture(scope="module")
def cramped(pristine, places):
    made = {}

    def make(name):
        if name not in made:
            made[name] = Cramped(WRITERS[name], pristine, places)
        made[name].lay_out()
        return made[name]

    return make


class Tally:
    """What was tried, and what went wrong in it."""

    def __init__(self):
        self.kind, self.tried, self.wrong = "", 0, []

    def judge(self, what, judge, *arguments, **options):
        self.tried += 1
        try:
            return judge(*arguments, **options)
        except AssertionError as exc:
            self.wrong.append(f"{what}: {exc}")
            return False


@pytest.fixture
def tally(reported):
    found = Tally()
    yield found
    reported(found.kind, found.tried, len(found.wrong))
    assert not found.wrong, "\n".join([f"{len(found.wrong)} of {found.tried}", *found.wrong[:5]])


def levels(is_full, few, step=1):
    """Say how much to leave: little by little more in a full run."""
    return itertools.count(0, step) if is_full else few


@pytest.mark.parametrize("name", WRITERS)
def test_without_room_nothing_changes_and_the_work_is_done_later(
    name, cramped, small_disk, is_full, tally
):
    tally.kind, command = f"full disk {name}", cramped(name)
    for pages in levels(is_full, [command.pages // 2], 1 + command.pages // 50):
        command.lay_out()
        small_disk.leave_pages(pages)
        if tally.judge(f"{pages} pages", command.judge):
            assert pages or name in EFFORTLESS
            break
        assert pages <= 2 * command.pages + 2


@pytest.mark.parametrize("name", WRITERS)
def test_without_names_for_files_nothing_changes_and_the_work_is_done_later(
    name, cramped, small_disk, is_full, tally
):
    tally.kind, command = f"no inodes {name}", cramped(name)
    for files in levels(is_full, [0]):
        command.lay_out()
        small_disk.leave_files(files)
        if tally.judge(f"{files} files", command.judge):
            break
        assert files <= 60


@pytest.mark.parametrize("name", WRITERS)
def test_with_a_limit_for_files_nothing_changes_and_the_work_is_done_later(
    name, cramped, is_full, tally
):
    tally.kind, command = f"file-size limit {name}", cramped(name)
    limits = {0, *(size // 2 for size in command.sizes), *(size - 1 for size in command.sizes)}
    few = [max(command.sizes, default=0) // 2]
    for limit in sorted(limits) if is_full else few:
        command.lay_out()
        tally.judge(f"{limit} bytes", command.judge, file_size=limit)


@pytest.fixture(params=["read-only disk", "closed folders"])
def close(request, places):
    """Make the world one that may be read and not be written."""
    if request.param == "closed folders":
        return places.close_folders
    if not places.has_disk:
        pytest.skip("mounting a disk is not allowed here")
    return places.make_read_only


def test_where_nothing_may_be_written_no_input_is_read(cramped, places, close, tally):
    tally.kind = f"writers, {close.__name__}"
    for name in WRITERS.keys() - EFFORTLESS:
        tally.judge(name, judge_closed, cramped(name), places, close)


def judge_closed(command, places, close):
    """A command whose inputs are nonsense, in a closed place: it is the place that is told."""
    command.spoil_inputs()
    before = tree_of(places.seen)
    close()
    ending = command.run(powerless=True)
    places.make_room()
    assert tree_of(places.seen) == before
    assert ending.code == 7, ending
    assert CLOSED.fullmatch(ending.said), ending.said
    if not command.writer.name.startswith(NO_INPUTS):
        assert command.run().code in (2, 3, 4, 5)


def test_where_the_folder_is_missing_no_input_is_read(cramped, places, tally):
    tally.kind = "writers, no folder"
    for name in WRITERS.keys() - {"man"}:
        command = cramped(name)
        words = command.writer.words()
        for option, value in itertools.pairwise(words):
            if option.startswith("--") and value in command.writer.writes:
                told = [f"none/{word}" if word == value else word for word in words]
                tally.judge(name, judge_homeless, command, places, told)


def judge_homeless(command, places, words):
    command.lay_out()
    command.spoil_inputs()
    before = tree_of(places.seen)
    ending = places.run(words)
    assert tree_of(places.seen) == before
    assert ending.code == 2, ending
    assert NO_FOLDER.fullmatch(ending.said), ending.said


@pytest.fixture(scope="module")
def read(pristine, places):
    """What readers print and write where nothing hinders them."""
    found = {}
    for words in READERS:
        places.lay_out(pristine)
        found[words] = run_reader(places, words)
        assert found[words][0] == 0
    return found


def test_what_may_only_be_read_can_be_searched(pristine, places, read, close, tally):
    tally.kind = f"readers, {close.__name__}"
    places.lay_out(pristine)
    before = tree_of(places.seen)
    close()
    for words in READERS:
        found = run_reader(places, words, powerless=True)
        tally.judge(words, judge_same, found, read[words])
    places.make_room()
    tally.judge("the world", judge_same, tree_of(places.seen), before)


@pytest.fixture
def given_away(pristine, places):
    """Let the world belong to somebody else."""
    places.lay_out(pristine)
    try:
        give_away(places.seen)
    except PermissionError:
        pytest.skip("only the superuser can give files to somebody else")
    return places


def test_somebody_elses_store_can_be_searched_and_not_changed(given_away, read, tally):
    tally.kind = "somebody else's stores"
    before = tree_of(given_away.seen)
    for words in READERS:
        found = run_reader(given_away, words, powerless=True)
        tally.judge(words, judge_same, found, read[words])
    for name in WRITERS.keys() - EFFORTLESS:
        ending = given_away.run(WRITERS[name].words(), powerless=True)
        tally.judge(name, judge_refused, ending)
    assert tree_of(given_away.seen) == before


def judge_refused(ending):
    assert ending.code == 7, ending
    assert CLOSED.fullmatch(ending.said), ending.said


def test_a_folder_that_several_people_write_to_takes_documents_of_all(given_away):
    ours = given_away.seen / "ours"
    shutil.copytree(given_away.seen / "one.store", ours / "one.store")
    (ours / "one.store/LOCK").touch()
    give_away(ours)
    change_modes(ours, add=0o777)
    for words in (
        "index more --store ours/one.store --jobs 1",
        "merge one.store other.store --output ours/joined.store",
        "compact ours/one.store",
        "verify ours/one.store",
        "verify ours/joined.store",
    ):
        ending = given_away.run(words.split(), powerless=True)
        assert ending.code == 0, (words, ending)
    assert stores_of(ours)["one.store"][1].keys() == {"000003.h5", "000003.idx"}


def give_away(world):
    for folder, _, files in os.walk(world):
        for name in (".", *files):
            os.chown(f"{folder}/{name}", NOBODY, NOBODY)


def run_reader(places, words, **limits):
    """Run a command; give its exit code, what it said, and what it wrote elsewhere."""
    shutil.rmtree(places.elsewhere)
    places.elsewhere.mkdir()
    ending = places.run(words.split(), stdout=str(places.elsewhere / "out"), **limits)
    said = re.sub(r"\d+\.\d+ s\b", "some s", ending.said)
    return ending.code, said, tree_of(places.elsewhere)


def judge_same(found, expected):
    assert found == expected


def test_a_full_standard_output_is_told_and_the_work_is_done(cramped, places, tally):
    tally.kind = "writers, full standard output"
    for name in WRITERS:
        tally.judge(name, judge_mute, cramped(name), places)


def judge_mute(command, places):
    ending = command.run(stdout="/dev/full")
    assert command.is_done()
    if command.prints:
        assert ending.code == 7, ending
        assert ending.said.splitlines()[-1] == NO_OUTPUT
    else:
        assert ending.code == command.writer.code, ending


def test_a_reader_that_can_not_print_says_so(pristine, places, read, tally):
    tally.kind = "readers, full standard output"
    places.lay_out(pristine)
    for words in READERS:
        _, _, wrote = read[words]
        if wrote["out"] != NOTHING:
            ending = places.run(words.split(), stdout="/dev/full")
            tally.judge(words, judge_same, ending.code, 7)
            tally.judge(words, judge_same, ending.said.splitlines()[-1], NO_OUTPUT)
