"""Limits are lowered, and never raised."""

import resource

import pytest

from mocapidx.store.limits import limit

NONE = resource.RLIM_INFINITY


@pytest.mark.parametrize(
    ("soft", "hard", "most", "expected"),
    [
        (NONE, NONE, 7, (7, NONE)),
        (NONE, 5, 7, (5, 5)),
        (3, NONE, 7, (3, NONE)),
        (9, 9, 7, (7, 9)),
        (3, 5, 7, (3, 5)),
        (0, 0, 7, (0, 0)),
        (NONE, NONE, 0, (0, NONE)),
    ],
)
def test_the_lowest_holds(monkeypatch, soft, hard, most, expected):
    limits = {}
    monkeypatch.setattr(resource, "getrlimit", lambda _: (soft, hard))
    monkeypatch.setattr(resource, "setrlimit", limits.__setitem__)
    limit(resource.RLIMIT_AS, most)
    assert limits == {resource.RLIMIT_AS: expected}
