import pytest

from mocapidx.errors import FormatError, ParameterError
from mocapidx.tasks.labels import labels_from_names, place_labels, read_labels
from tests.made_store import make_document


def written(tmp_path, text):
    path = tmp_path / "labels.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def rows(tmp_path, text):
    return [
        (label.document, label.label, label.start_time, label.end_time, label.group)
        for label in read_labels(written(tmp_path, text)).labels
    ]


def test_two_columns_are_enough(tmp_path):
    assert rows(tmp_path, "document,label\na.amc,squat\nb.amc,jog\n") == [
        ("a.amc", "squat", None, None, None),
        ("b.amc", "jog", None, None, None),
    ]


def test_times_and_groups_are_optional_in_any_order_and_row(tmp_path):
    text = "group,end_time,start_time,label,document\nann,2.5,1,squat,a.amc\n,,3,jog,a.amc\n"
    assert rows(tmp_path, text) == [
        ("a.amc", "squat", 1.0, 2.5, "ann"),
        ("a.amc", "jog", 3.0, None, None),
    ]


@pytest.mark.parametrize(
    "text",
    [
        "\ufeffdocument,label\r\na.amc,squat\r\n",
        'document,label\n"a.amc","squat"',
        " document , label \n\na.amc, squat \n\n",
    ],
)
def test_marks_line_ends_quotes_and_blanks_do_no_harm(tmp_path, text):
    assert rows(tmp_path, text) == [("a.amc", "squat", None, None, None)]


def test_names_that_are_no_utf_8_survive(tmp_path):
    assert rows(tmp_path, b"document,label\n\xe4.amc,squat\n")[0][0] == "\udce4.amc"


def test_other_columns_are_passed_over_and_named(tmp_path):
    found = read_labels(written(tmp_path, "document,label,actor\na.amc,squat,bd\n"))
    assert [label.label for label in found.labels] == ["squat"]
    assert "actor" in found.remarks[0]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "labels.csv:1: the header has no column 'document'"),
        ("file,label\n", "labels.csv:1: the header has no column 'document'.*found file,label"),
        ("document,label,label\n", "labels.csv:1: the column 'label' stands twice"),
        ("document,label\n", "labels.csv: has no labels"),
        ("document,label\na.amc\n", "labels.csv:2: found 1 values, the header names 2 columns"),
        ("document,label\na.amc,\n", "labels.csv:2: the label is empty"),
        ("document,label\n,x\n", "labels.csv:2: the document is empty"),
        ('document,label\n"a.amc,x\n', "labels.csv:2: not CSV"),
        ("document,label,start_time\na,x,-1\n", "labels.csv:2: start_time must be seconds"),
        ("document,label,end_time\na,x,1e300\n", "labels.csv:2: end_time must be seconds"),
        ("document,label,start_time\na,x,nan\n", "labels.csv:2: start_time .* found 'nan'"),
        ("document,label,start_time\na,x,1_0\n", "labels.csv:2: start_time .* found '1_0'"),
        ("document,label,end_time\na,x,1e999\n", "labels.csv:2: end_time .* found '1e999'"),
        (
            "document,label,start_time,end_time\na,x,2,1\n",
            "labels.csv:2: end_time 1 must be later than start_time 2",
        ),
        (
            "document,label,start_time,end_time\na,x,3,5\nb,x,3,5\na,y,1,3.5\n",
            "labels.csv:2: 'x' overlaps 'y' of line 4 in a",
        ),
        ("document,label\na,x\na,x\n", "labels.csv:3: 'x' overlaps 'x' of line 2"),
        ("document,label,end_time\na,x,\na,y,1\n", "overlaps"),
    ],
)
def test_what_is_wrong_is_told_in_one_line_with_its_place(tmp_path, text, complaint):
    with pytest.raises(FormatError, match=complaint) as caught:
        read_labels(written(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_stretches_that_touch_do_not_overlap(tmp_path):
    text = "document,label,start_time,end_time\na,x,1,2\na,y,2,3\n"
    assert len(rows(tmp_path, text)) == 2


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(FormatError, match="no such labels file"):
        read_labels(tmp_path / "none.csv")
    with pytest.raises(FormatError, match="a folder without labels"):
        read_labels(tmp_path)


def test_folders_and_expressions_give_labels():
    names = ["squat/bd_1.amc", "deep/jog/bk_2.amc", "loose.amc"]
    by_folder = labels_from_names(names, "folder")
    assert [(label.document, label.label) for label in by_folder.labels] == [
        ("squat/bd_1.amc", "squat"),
        ("deep/jog/bk_2.amc", "jog"),
    ]
    assert "without a label: 1 document" in by_folder.remarks[0]
    by_match = labels_from_names(names, r"(?P<label>\w+)/(?P<group>[a-z]+)_")
    assert [(label.label, label.group) for label in by_match.labels] == [
        ("squat", "bd"),
        ("jog", "bk"),
    ]


@pytest.mark.parametrize(
    ("rule", "complaint"),
    [("(", "no regular expression"), ("a+", "expected 'folder'"), ("(?P<label>z)", "no document")],
)
def test_a_rule_that_gives_no_labels_is_refused(rule, complaint):
    with pytest.raises(ParameterError, match=complaint):
        labels_from_names(["a.amc"], rule)


def placed(tmp_path, text, shortest=3):
    documents = [make_document("a.amc", 90), make_document("b.amc", 60)]
    labels = read_labels(written(tmp_path, text)).labels
    return [
        (example.document, example.start, example.end)
        for example in place_labels(labels, documents, 30.0, shortest)
    ]


def test_times_become_frames_of_the_store(tmp_path):
    text = "document,label,start_time,end_time\nb.amc,x,0.5,1.1\na.amc,x,,2.03\na.amc,y,2.5,3.4\n"
    assert placed(tmp_path, text) == [(1, 15, 33), (0, 0, 61), (0, 75, 90)]


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("c.amc,x,,", "labels.csv:2: no document 'c.amc'"),
        ("a.amc,x,3,4", "labels.csv:2: a.amc lasts 3.00 s, the label goes from 3.00 s to 4.00 s"),
        ("a.amc,x,1,9", "labels.csv:2: a.amc lasts 3.00 s"),
        ("a.amc,x,1,1.05", "labels.csv:2: 'x' has 2 frames at 30 Hz.*at least 3"),
        ("a.amc,x,1,1e300", "labels.csv:2"),
    ],
)
def test_labels_that_do_not_lie_in_a_document_are_refused(tmp_path, row, complaint):
    with pytest.raises(FormatError, match=complaint):
        placed(tmp_path, f"document,label,start_time,end_time\n{row}\n")
