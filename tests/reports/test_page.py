import base64
import dataclasses
import hashlib
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.reports.page.content import PageCurve
from mocapidx.reports.page.encode import UNKNOWN, encode_content, encode_poses
from mocapidx.reports.page.html import PROGRAMS, page_html
from mocapidx.reports.page.stills import still_picture
from mocapidx.skeleton.joints import CANONICAL_JOINTS, INDEX
from tests.made_page import ODD, content, standing

ROOT = Path(__file__).parents[2]
STATIC = ROOT / "mocapidx" / "reports" / "page" / "static"


def data_of(page):
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    return json.loads(found[1])


@given(
    st.floats(-50, 50), st.floats(0.001, 20), st.integers(1, 5), st.integers(0, 23), st.booleans()
)
def test_poses_are_kept_to_half_a_millimetre(middle, reach, frames, joint, lacking):
    random = np.random.default_rng(frames)
    poses = (middle + reach * random.uniform(-1, 1, (frames, 24, 3))).astype(np.float32)
    if lacking:
        poses[:, joint] = np.nan
    origin, unit, text = encode_poses(poses)
    values = np.frombuffer(base64.b64decode(text), "<i2").reshape(poses.shape)
    back = (np.array(origin) + unit * values.astype(np.float64)) / 1000
    assert unit == 1
    assert ((values == UNKNOWN) == np.isnan(poses)).all()
    known = np.isfinite(poses)
    assert np.abs(back - poses)[known].max() <= 0.000501


def test_a_motion_larger_than_a_hall_is_kept_more_coarsely():
    poses = standing(move=10.0)
    origin, unit, text = encode_poses(poses)
    values = np.frombuffer(base64.b64decode(text), "<i2").reshape(poses.shape)
    back = (np.array(origin) + unit * values.astype(np.float64)) / 1000
    assert unit == 5
    assert np.abs(back - poses).max() <= unit / 2000 + 1e-6


def test_a_skeleton_without_any_joint_is_still_drawn_as_nothing():
    poses = np.full((2, 24, 3), np.nan, np.float32)
    assert encode_poses(poses)[:2] == ([0, 0, 0], 1)
    assert "NaN" not in still_picture(poses, 1.0, 0.0)
    assert "nan" not in still_picture(poses, 1.0, 0.0)


@pytest.mark.parametrize("value", [np.inf, -np.inf, 1e30, -3e38])
def test_positions_that_no_body_has_do_no_harm(value):
    poses = standing()
    poses[3, 5] = poses[20, 7, 1] = value
    made = content()
    piece = dataclasses.replace(made.documents[0].pieces[0], poses=poses)
    document = dataclasses.replace(made.documents[0], pieces=(piece,))
    page = page_html(dataclasses.replace(made, documents=(document,)))
    (found,) = data_of(page)["documents"][0]["pieces"]
    assert len(base64.b64decode(found["poses"])) == poses.size * 2


def test_the_data_holds_what_the_page_needs_to_draw():
    data = data_of(page_html(content()))
    assert data["joints"] == list(CANONICAL_JOINTS)
    assert data["sides"][INDEX["lhip"]] + data["sides"][INDEX["rtoes"]] + data["sides"][0] == "lrm"
    (document,) = data["documents"]
    assert document["untrusted"] == "4"
    (piece,) = document["pieces"]
    assert (piece["start"], piece["frames"], piece["step"]) == (10, 30, 1)
    words = np.frombuffer(base64.b64decode(piece["words"]), np.uint8).reshape(30, 5)
    assert words[3].tolist() == [3, 0, 0, 0, 1 << 5]
    costs = np.frombuffer(base64.b64decode(document["curves"][0]["costs"]), "<u2")
    assert costs[19:21].tolist() == [65535, 500]
    assert [hit["reference"] for hit in data["hits"]] == [None, 0]


def test_half_the_poses_keep_all_feature_words():
    made = content()
    piece = dataclasses.replace(made.documents[0].pieces[0], step=2)
    documents = (dataclasses.replace(made.documents[0], pieces=(piece,)),)
    (found,) = data_of(page_html(dataclasses.replace(made, documents=documents)))["documents"]
    assert len(base64.b64decode(found["pieces"][0]["poses"])) == 15 * 24 * 3 * 2
    assert len(base64.b64decode(found["pieces"][0]["words"])) == 30 * 5


def test_a_long_distance_function_keeps_its_minima():
    costs = np.full(90_001, 0.5, np.float32)
    costs[[12_345, 90_000]] = 0.01
    made = content()
    documents = (dataclasses.replace(made.documents[0], curves=(PageCurve("walk", 0.1, costs),)),)
    text = encode_content(dataclasses.replace(made, documents=documents), {"walk": "#000000"})
    (curve,) = json.loads(text)["documents"][0]["curves"]
    kept = np.frombuffer(base64.b64decode(curve["costs"]), "<u2")
    assert len(kept) <= 4000
    assert np.flatnonzero(kept == 100).tolist() == [12_345 // curve["every"], len(kept) - 1]


def test_equal_contents_give_equal_pages():
    assert page_html(content()) == page_html(content())


def test_the_policy_names_the_digest_of_each_program_and_allows_nothing_else():
    page = page_html(content())
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)[1]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    programs = re.findall(r'<script(?: type="module")?>(.*?)</script>', page, re.DOTALL)
    styles = re.findall(r"<style>(.*?)</style>", page, re.DOTALL)

    def digests(texts):
        return " ".join(
            f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
            for text in texts
        )

    assert rules == {
        "default-src": "'none'",
        "script-src": digests(programs),
        "style-src": digests(styles),
        "img-src": "data:",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    assert len(programs) == 2


def test_nothing_points_outside_and_no_markup_has_a_style_or_a_handler_of_its_own():
    page = page_html(content())
    markup = re.sub(r"<(script|style)\b.*?</\1>", "", page, flags=re.DOTALL)
    assert not re.search(r"""\s(style|on\w+|action|srcset|formaction)\s*=""", markup)
    assert re.findall(r"""\s(?:src|href)\s*=\s*"([^"]*)\"""", markup) == ["data:,"]
    own = "".join((STATIC / name).read_text() for name in (*PROGRAMS, "page.css"))
    assert not re.search(r"https?:|url\(|@import|innerHTML|outerHTML|eval\(|fetch\(", own)


def test_names_are_text_wherever_they_stand():
    page = page_html(content(name=f"a/{ODD}.bvh", label=ODD, title=ODD, remarks=(ODD,)))
    assert len(re.findall(r"<script", page)) == 3
    assert "alert(&quot;1" in page
    data = data_of(page)
    assert data["classes"][0]["label"].startswith('</script><script>alert("1")</script> {{data}}')
    assert "\\x1b" in data["documents"][0]["name"]
    for raw in ("\x1b", "\udc80", "\u202e"):
        assert raw not in page
    page.encode()


def test_no_program_ends_its_own_element():
    for name in ("three.min.js", *PROGRAMS):
        text = (STATIC / name).read_text()
        assert "</script" not in text.lower()
        assert "<!--" not in text
        assert "\r" not in text


def test_the_library_carries_its_version_and_its_licence():
    wanted = json.loads((ROOT / "three" / "package.json").read_text())["dependencies"]["three"]
    head = (STATIC / "three.min.js").read_text()[:1500]
    assert head.startswith(f"/*! three.js {wanted}\n")
    assert "The MIT License" in head
    assert "above copyright notice and this permission notice" in head


def test_a_page_of_no_hits_says_so():
    page = page_html(content(hits=(), documents=(), references=()))
    assert "There are no hits." in page
    assert data_of(page)["hits"] == []


def test_a_still_shows_five_poses_with_left_and_right_apart():
    still = still_picture(standing(), 1.0, 0.0)
    assert still.count("<g ") == 5
    assert still.count('class="l"') == still.count('class="r"') == 10
    assert still_picture(standing(1), 1.0, 0.0).count("<g ") == 1
    assert "<script" not in still


def test_a_still_is_seen_from_where_the_person_faces():
    # Turned about the vertical, the same pose gives the same picture.
    turn = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]], np.float32)
    poses = standing(move=0.0)
    poses[:, INDEX["lfingers"], 2] = 0.4
    assert still_picture(poses, 1.0, 0.0) == still_picture(poses @ turn.T, 1.0, 0.0)


def test_the_library_is_what_its_packages_give(tmp_path):
    if shutil.which("npm") is None:
        pytest.skip("no npm here to bundle three.js with")
    shutil.copytree(ROOT / "three", tmp_path / "three", ignore=shutil.ignore_patterns("node_*"))
    made = tmp_path / "three.min.js"
    # One try, briefly: where there is no network, npm would wait for minutes.
    patience = {"npm_config_fetch_retries": "0", "npm_config_fetch_timeout": "30000"}
    command = ["sh", tmp_path / "three" / "bundle.sh", made]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=300, env=os.environ | patience
    )
    if done.returncode and "npm error" in done.stderr and not made.exists():
        pytest.skip("npm could not get three.js and esbuild")
    assert done.returncode == 0, done.stderr
    assert made.read_bytes() == (STATIC / "three.min.js").read_bytes()
