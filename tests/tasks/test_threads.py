import threading

import pytest

from mocapidx.tasks import threads
from mocapidx.tasks.threads import map_ahead


@pytest.fixture(params=[1, 2, 3])
def several(request, monkeypatch):
    monkeypatch.setattr(threads, "thread_count", lambda: request.param)
    return request.param


@pytest.mark.parametrize("count", [0, 1, 2, 3, 20])
def test_results_come_in_the_order_of_the_items(several, count):
    assert list(map_ahead(lambda item: item * item, range(count))) == [i * i for i in range(count)]


def test_items_are_taken_a_few_ahead_only(several):
    taken = []

    def items():
        for item in range(50):
            taken.append(item)
            yield item

    for place, _ in enumerate(map_ahead(str, items())):
        assert len(taken) <= place + several + 2


def test_an_error_comes_out_where_its_result_would_and_ends_the_threads(several):
    before = threading.active_count()

    def divide(item):
        return 1 / (3 - item)

    results = map_ahead(divide, range(10))
    assert [next(results) for _ in range(3)] == [1 / 3, 1 / 2, 1]
    with pytest.raises(ZeroDivisionError):
        next(results)
    assert threading.active_count() == before


def test_stopping_early_leaves_no_thread_behind(several):
    before = threading.active_count()
    results = map_ahead(str, range(100))
    next(results)
    results.close()
    assert threading.active_count() == before


def test_a_single_item_starts_no_thread(monkeypatch):
    monkeypatch.setattr(threads, "thread_count", lambda: 4)
    here = threading.get_ident()
    assert list(map_ahead(lambda _: threading.get_ident(), [0])) == [here]
