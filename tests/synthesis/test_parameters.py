import numpy as np
import pytest

from mocapidx.errors import FormatError
from mocapidx.skeleton.joints import INDEX
from mocapidx.synthesis.parameters import measure, parse_parameters

TIMES = np.linspace(0, 2, 41)


def points():
    """A body that stands, while its right foot goes up to 1.2 m at 0.73 s and out to the front."""
    pose = np.zeros((41, 24, 3))
    pose[:, INDEX["lhip"], 0], pose[:, INDEX["rhip"], 0] = 0.1, -0.1
    pose[:, INDEX["root"], 1] = 1 - 0.2 * np.sin(TIMES * np.pi / 2)
    foot = pose[:, INDEX["rankle"]]
    foot[:, 0], foot[:, 2] = -0.1, 0.5 * TIMES
    foot[:, 1] = 1.2 - (TIMES - 0.73) ** 2
    pose[:, INDEX["rknee"]] = (foot + pose[:, INDEX["rhip"]]) / 2
    return pose


def measured(text):
    return measure(parse_parameters(text, "p.toml"), points(), TIMES, TIMES * 1.5).tolist()


def table(**entries):
    return "[[parameter]]\n" + "".join(f"{key} = {value}\n" for key, value in entries.items())


@pytest.mark.parametrize(
    ("entries", "expected"),
    [
        ({"joint": '"rankle"', "when": '"start"'}, [-0.1, 1.2 - 0.73**2, 0]),
        ({"joint": '"rankle"', "when": '"end"', "axes": '"zx"'}, [1.0, -0.1]),
        ({"joint": '"rankle"', "when": '{ max = "height", joint = "rankle" }'}, [-0.1, 1.2, 0.365]),
        ({"joint": '"rankle"', "when": "0.75", "axes": '"z"'}, [0.25]),
        ({"joint": '"rankle"', "relative_to": '"root"', "when": '"end"', "axes": '"z"'}, [1.0]),
        ({"joint": '"root"', "what": '"height"', "when": '"min"'}, [0.8]),
        ({"joint": '"root"', "what": '"height"', "when": '"mean"'}, [1 - 0.4 / np.pi]),
        ({"joint": '"rankle"', "what": '"speed"', "when": '"start"'}, [np.hypot(0.5, 1.46)]),
        ({"joint": '"rhip"', "what": '"distance"', "from": '"lhip"', "when": '"end"'}, [0.2]),
        (
            {"joint": '"rknee"', "what": '"angle"', "between": '["rhip", "rankle"]', "when": "1"},
            [180],
        ),
        ({"what": '"facing"', "when": '"mean"'}, [0]),
        ({"what": '"duration"'}, [2]),
    ],
)
def test_quantities_at_their_moments(entries, expected):
    np.testing.assert_allclose(measured(table(**entries)), expected, atol=2e-3)


def test_several_tables_are_several_parameters():
    text = table(joint='"rankle"', when='"end"') + table(what='"duration"')
    parameters = parse_parameters(text, "p.toml")
    assert parameters.names == ("rankle x", "rankle y", "rankle z", "duration")
    assert parameters.units == ("m", "m", "m", "s")
    assert len(measured(text)) == 4
    assert parse_parameters(table(what='"facing"', when='"end"'), "p").scales[0] > 50


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no .*parameter"),
        ("parameter = 3", "no .*parameter"),
        ("x = 1\n" + table(what='"duration"'), "unknown key 'x'"),
        ("name = 1\n" + table(what='"duration"'), "'name' is no text"),
        ("not toml", "is not TOML"),
        (table(what='"mood"'), "'what' is 'mood', expected one of position"),
        (table(when='"end"'), "'joint' is missing; expected one of the joints root"),
        (table(joint='"tail"', when='"end"'), "'joint' is 'tail'"),
        (table(joint='"root"'), "'when' is missing"),
        (table(joint='"root"', when='"max"'), "a position has no max; say of what"),
        (table(joint='"root"', when="-1"), "'when' is -1"),
        (table(joint='"root"', when='{ max = "mood" }'), "when: 'what' is 'mood'"),
        (table(joint='"root"', when='{ max = "position", joint = "root" }'), "no largest"),
        (table(joint='"root"', when="{ }"), "'when' is"),
        (table(joint='"root"', when='"end"', axes='"xx"'), "'axes' is 'xx'"),
        (table(joint='"root"', when='"end"', axes="3"), "'axes' is 3"),
        (table(joint='"root"', when='"end"', speed="3"), "'speed' is no key for position"),
        (table(joint='"root"', what='"angle"', when='"end"'), "'between' must name two"),
        (table(what='"duration"', joint='"root"'), "'joint' is no key for duration"),
        (table(joint='"root"', when='"end"') * 3, "9 numbers to steer by, at most 6"),
    ],
)
def test_a_file_that_is_wrong_is_refused_in_one_line(text, complaint):
    with pytest.raises(FormatError, match=complaint) as caught:
        parse_parameters(text, "p.toml")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("p.toml")
