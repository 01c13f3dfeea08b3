"""What docs/queries.md shows is what the program prints."""

from fixtures.session import QUERIES, commands, generate_place, renewed


def test_the_five_questions_have_the_answers_that_are_shown(tmp_path):
    text = QUERIES.read_text(encoding="utf-8")
    generate_place(tmp_path)
    printed = list(commands(renewed(text, tmp_path)))
    assert len(printed) > 5
    for (command, shown), (_, now) in zip(commands(text), printed, strict=True):
        assert now == shown, f"{command}\n'python -m fixtures.session' renews what is shown"
