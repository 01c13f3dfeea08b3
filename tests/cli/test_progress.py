import io

import pytest

from mocapidx_cli import main, progress
from mocapidx_cli.progress import Bar


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_a_log_gets_a_plain_line_a_minute(clock, capsys):
    with Bar("doc", quiet=False) as bar:
        for done in range(1, 10):
            clock[0] += 20
            bar.show(done, 30, frames=done * 4000)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "3 of 30 doc, 12000 frames, 200/s, about 9 min left"
    assert len(lines) == 3


@pytest.mark.parametrize("quiet", [True, False])
def test_what_is_quick_or_quiet_says_nothing_in_a_log(clock, capsys, quiet):
    with Bar("doc", quiet) as bar:
        clock[0] += 1000 if quiet else 59
        bar.show(1, 2)
    assert capsys.readouterr().err == ""


def test_a_terminal_gets_a_bar_with_rate_and_time_left(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(main.sys, "stderr", terminal)
    with Bar("doc", quiet=False) as bar:
        bar.show(1, 4, frames=100)
        bar.write("a line above")
        bar.show(4, 4, frames=400)
    assert "4/4" in terminal.getvalue()
    assert "400 frames" in terminal.getvalue()
    assert "a line above\n" in terminal.getvalue()


@pytest.mark.parametrize(
    ("environment", "coloured"),
    [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)],
)
def test_errors_have_a_colour_on_a_terminal_unless_unwanted(monkeypatch, environment, coloured):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    terminal = Terminal()
    monkeypatch.setattr(main.sys, "stderr", terminal)
    main.say("Error: it's \x1b[2J: gone")
    expected = "\x1b[1;31mError:\x1b[0m" if coloured else "Error:"
    assert terminal.getvalue() == f"{expected} it's \\x1b[2J: gone\n"


def test_a_log_has_no_colours(capsys):
    main.say("Error: it's gone")
    assert capsys.readouterr().err == "Error: it's gone\n"
