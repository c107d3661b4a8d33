"""Tests of what stands for functions of numpy that import numpy.ma."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from msggen.recordings.columns.ordered import distinct, median, percentiles

FLOATS = arrays(np.float64, st.integers(1, 30), elements=st.floats(-1e6, 1e6))
NUMBERS = FLOATS | arrays(np.int64, st.integers(1, 30), elements=st.integers(-9, 9))


@given(NUMBERS)
def test_they_return_what_numpy_does(values: Any) -> None:
    np.testing.assert_array_equal(distinct(values), np.unique(values))
    np.testing.assert_allclose(median(values), np.median(values), atol=1e-9)
    with_nan = np.append(values, np.nan)
    np.testing.assert_allclose(percentiles(with_nan, (5, 95)), np.nanpercentile(with_nan, (5, 95)), atol=1e-6)


def test_without_numbers_they_are_not_known() -> None:
    assert np.isnan(median(np.zeros(0)))
    assert np.isnan(percentiles(np.array([np.nan]), (5, 95))).all()


def test_nan_is_one_value() -> None:
    np.testing.assert_array_equal(distinct(np.array([np.nan, 1.0, np.nan])), [1.0, np.nan])
