"""Conditions on documents: ``actor = ann and class != walk and seconds > 2``.

The grammar::

    condition  = either { "or" either }
    either     = part { "and" part }
    part       = "not" part | "(" condition ")" | comparison
    comparison = key ( "=" | "!=" | "<" | "<=" | ">" | ">=" ) value

Values and texts without blanks need no quotes. ``*`` and ``?`` in a value stand for any
characters, upper and lower case are the same, and what looks like numbers on both sides is
compared as numbers. A document that lacks a key meets no comparison with it.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from fnmatch import translate
from typing import Final, TypeAlias

from mocapidx.errors import ParameterError
from mocapidx.printable import shown
from mocapidx.store.manifest import Document

__all__ = ["Condition", "document_facts", "meeting", "name_facts", "name_regex", "parse_where"]

Facts: TypeAlias = Mapping[str, str | float]
Test: TypeAlias = Callable[[Facts], bool]

TOKEN: Final = re.compile(
    r"\s*(?:(?P<operator><=|>=|!=|=|<|>)|(?P<bracket>[()])"
    r"|\"(?P<double>[^\"]*)\"|'(?P<single>[^']*)'|(?P<word>[^\s()=<>!\"']+))"
)
MOST_TEXT: Final = 10_000
DEEPEST: Final = 50
LONGEST_PATTERN: Final = 1000

TAKEN: Final = frozenset(
    ("document", "seconds", "frames", "source", "source_frames", "source_rate_hz", "joint_map")
)
"""Keys with a meaning of their own in lists and conditions."""


class Condition:
    """A condition on documents, and the keys that it asks for.

    Parameters
    ----------
    test : callable
        From facts to whether they meet it.
    keys : sequence of str
    """

    def __init__(self, test: Test, keys: Sequence[str]) -> None:
        self.test = test
        self.keys = tuple(dict.fromkeys(keys))

    def holds(self, facts: Facts) -> bool:
        """Tell whether a document with these facts meets the condition."""
        return self.test(facts)


def parse_where(text: str) -> Condition:
    """Understand a condition on documents.

    Parameters
    ----------
    text : str
        By the grammar of this module.

    Returns
    -------
    Condition

    Raises
    ------
    ParameterError
        If it can't be understood; the message says from where.
    """
    if len(text) > MOST_TEXT:
        raise ParameterError(f"a condition of {len(text)} characters; at most {MOST_TEXT}")
    return _Parser(text).condition()


class _Parser:
    """Reads one condition from left to right."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.tokens: list[tuple[str, str]] = []
        self.keys: list[str] = []
        self.place = self.depth = 0
        at = 0
        while text[at:].strip():
            found = TOKEN.match(text, at)
            if found is None:
                raise self.wrong(text[at:].strip())
            kind = str(found.lastgroup)
            self.tokens.append((kind, found[kind]))
            at = found.end()

    def condition(self) -> Condition:
        test = self.any_of()
        if self.place < len(self.tokens):
            raise self.wrong(self.tokens[self.place][1])
        return Condition(test, self.keys)

    def any_of(self) -> Test:
        tests = [self.all_of()]
        while self.take("or"):
            tests.append(self.all_of())
        return lambda facts: any(test(facts) for test in tests)

    def all_of(self) -> Test:
        tests = [self.part()]
        while self.take("and"):
            tests.append(self.part())
        return lambda facts: all(test(facts) for test in tests)

    def part(self) -> Test:
        self.depth += 1
        if self.depth > DEEPEST:
            raise ParameterError(f"a condition nests at most {DEEPEST} deep")
        if self.take("not"):
            inverse = self.part()
            test: Test = lambda facts: not inverse(facts)  # noqa: E731
        elif self.take("(", "bracket"):
            test = self.any_of()
            if not self.take(")", "bracket"):
                raise self.wrong("the end")
        else:
            test = self.comparison()
        self.depth -= 1
        return test

    def comparison(self) -> Test:
        key = self.next("word").lower()
        operator = self.next("operator")
        value = self.next("word", "double", "single")
        self.keys.append(key)
        return _comparison(key, operator, value)

    def take(self, token: str, kind: str = "word") -> bool:
        if self.place < len(self.tokens):
            found, text = self.tokens[self.place]
            if found == kind and text.lower() == token:
                self.place += 1
                return True
        return False

    def next(self, *kinds: str) -> str:
        if self.place >= len(self.tokens):
            raise self.wrong("the end")
        kind, text = self.tokens[self.place]
        if kind not in kinds:
            raise self.wrong(text)
        self.place += 1
        return text

    def wrong(self, at: str) -> ParameterError:
        return ParameterError(
            f"can't understand the condition '{shown(self.text)}' at '{shown(at, 40)}'; it must "
            "read like: actor = ann and (class = kick* or not take > 3)"
        )


def _comparison(key: str, operator: str, value: str) -> Test:
    number = _number(value)
    pattern = re.compile(_glob(value), re.IGNORECASE | re.DOTALL)

    def test(facts: Facts) -> bool:
        if key not in facts:
            return False
        found = facts[key]
        if operator in ("=", "!="):
            same = pattern.fullmatch(str(found)) is not None
            if number is not None and _number(found) is not None:
                same = _number(found) == number
            return same == (operator == "=")
        mine, yours = _number(found), number
        if mine is None or yours is None:
            return _ordered(str(found).lower(), value.lower(), operator)
        return _ordered(mine, yours, operator)

    return test


def _glob(value: str) -> str:
    """Turn ``*`` and ``?`` into a regular expression; brackets stand for themselves."""
    return translate(re.sub(r"\*+", "*", value).replace("[", "[[]"))


def _ordered(mine: str | float, yours: str | float, operator: str) -> bool:
    if mine == yours:
        return operator in ("<=", ">=")
    return (mine < yours) == operator.startswith("<")  # type: ignore[operator]


def _number(value: str | float) -> float | None:
    try:
        number = float(value)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def document_facts(document: Document, rate: float) -> dict[str, str | float]:
    """Give what is known of a document under the keys that conditions ask for.

    Parameters
    ----------
    document : Document
    rate : float
        The store's, in Hz.

    Returns
    -------
    dict of str to str or float
        What its name tells by the pattern it was indexed with, in lower-case keys; and
        ``document`` (its name), ``seconds``, ``frames``, ``rate`` (of the source, in Hz).
    """
    return {
        "document": document.name,
        "seconds": document.frames / rate,
        "frames": float(document.frames),
        "rate": document.source_rate,
        **document.facts,
    }


def meeting(documents: Sequence[Document], text: str, rate: float) -> list[bool]:
    """Tell which documents meet a condition.

    Parameters
    ----------
    documents : sequence of Document
        Those that are not live meet none.
    text : str
        By the grammar of this module.
    rate : float
        The store's, in Hz.

    Returns
    -------
    list of bool

    Raises
    ------
    ParameterError
        If it can't be understood, or asks for what no document has.
    """
    condition = parse_where(text)
    facts = [document_facts(document, rate) if document.live else None for document in documents]
    known = dict.fromkeys(key for each in facts if each is not None for key in each)
    for key in condition.keys:
        if known and key not in known:
            raise ParameterError(
                f"no document has '{shown(key)}'; there are {', '.join(map(shown, known))} "
                "('index --name-pattern' takes more from the names)"
            )
    return [each is not None and condition.holds(each) for each in facts]


def name_regex(pattern: str) -> re.Pattern[str]:
    """Understand a name pattern.

    Parameters
    ----------
    pattern : str
        A regular expression with named groups, such as ``(?P<actor>[a-z]+)_(?P<take>[0-9]+)``.

    Returns
    -------
    re.Pattern

    Raises
    ------
    ParameterError
        If it is none, has no named group, or names one like a fact that every document has.
    """
    if len(pattern) > LONGEST_PATTERN:
        raise ParameterError(f"a name pattern of {len(pattern)} characters")
    try:
        regex = re.compile(pattern)
    except (re.error, RecursionError, OverflowError) as exc:
        raise ParameterError(f"'{shown(pattern)}' is no regular expression: {exc}") from exc
    if not regex.groupindex:
        raise ParameterError(
            f"'{shown(pattern)}' has no named groups, such as (?P<actor>[a-z]+)_(?P<take>[0-9]+)"
        )
    names = [name.lower() for name in regex.groupindex]
    if len(set(names)) < len(names) or set(names) & TAKEN:
        taken = ", ".join(sorted(TAKEN))
        raise ParameterError(f"'{shown(pattern)}': groups must differ, and not be called {taken}")
    return regex


def name_facts(regex: re.Pattern[str] | None, name: str) -> dict[str, str]:
    """Take facts from a document's name.

    Parameters
    ----------
    regex : re.Pattern or None
        Searched for anywhere in the name; None tells nothing.
    name : str

    Returns
    -------
    dict of str to str
        By the names of the groups, in lower case; groups that are not there are left out. Empty
        where the pattern is not found.
    """
    found = None if regex is None else regex.search(name)
    groups = {} if found is None else found.groupdict()
    return {key.lower(): value for key, value in sorted(groups.items()) if value is not None}
