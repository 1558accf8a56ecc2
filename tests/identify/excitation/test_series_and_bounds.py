import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from identify.excitation.bounds import series_bounds, series_extremes
from identify.excitation.series import FourierSeries

coefficient = st.floats(-2.0, 2.0, allow_nan=False)


@st.composite
def series(draw):
    harmonics = draw(st.integers(1, 6))
    table = draw(st.lists(coefficient, min_size=2 * harmonics + 1, max_size=2 * harmonics + 1))
    a = np.array(table)
    return FourierSeries(0.3, a[:1], a[None, 1 : 1 + harmonics], a[None, 1 + harmonics :])


@settings(max_examples=60, deadline=None)
@given(series(), st.integers(0, 2))
def test_bounds_hold_between_the_samples_and_are_tight(motion, order):
    low, high = series_bounds(motion, order)
    least, most = series_extremes(motion, order)
    dense = motion.evaluate(np.linspace(0.0, motion.period_s, 40_003))[order][0]
    assert low[0] <= dense.min() + 1e-12 and dense.max() - 1e-12 <= high[0]
    scale = motion.amplitude(order)[0] + 1e-9
    assert abs(least[0] - dense.min()) < 1e-5 * scale and abs(most[0] - dense.max()) < 1e-5 * scale
    assert high[0] - most[0] < 1e-3 * scale and least[0] - low[0] < 1e-3 * scale


def test_derivatives_agree_with_differences(random_series):
    t = np.linspace(0.0, 10.0, 200_001)
    q, qd, qdd = random_series.evaluate(t)
    np.testing.assert_allclose(np.gradient(q, t, axis=1)[:, 1:-1], qd[:, 1:-1], atol=1e-6)
    np.testing.assert_allclose(np.gradient(qd, t, axis=1)[:, 1:-1], qdd[:, 1:-1], atol=1e-6)
    np.testing.assert_allclose(random_series.derivative(2).evaluate(t)[0], qdd, atol=1e-9)


def test_constant_joint_has_equal_extremes():
    still = FourierSeries(0.1, np.array([0.4]), np.zeros((1, 3)), np.zeros((1, 3)))
    assert series_extremes(still, 0) == (np.array([0.4]), np.array([0.4]))
