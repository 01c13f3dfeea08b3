import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.skeleton.quantiles import median, quantile

ROWS = st.lists(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=2), min_size=1, max_size=30)


@given(ROWS, st.sampled_from([0.0, 0.05, 0.25, 0.5, 0.9, 1.0]))
def test_quantiles_are_numpy_s(rows, share):
    values = np.array(rows)
    expected = np.quantile(values, share, axis=0)
    assert quantile(values, share) == pytest.approx(expected, rel=1e-12, abs=1e-9)
    assert median(values) == pytest.approx(np.median(values, axis=0), rel=1e-12, abs=1e-9)


def test_what_is_unknown_stays_so():
    values = np.array([[1.0, 2.0], [np.nan, 3.0], [0.0, 4.0]])
    assert np.isnan(median(values)).tolist() == [True, False]
