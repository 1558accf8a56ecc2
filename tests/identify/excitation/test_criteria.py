import numpy as np
import pytest

from identify.excitation.criteria import AOptimal, Balanced, ConditionNumber, DOptimal, condition_number
from identify.excitation.discriminate import Discriminating, smallest_detectable


@pytest.fixture
def matrix():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(40, 6)) * np.array([1.0, 30.0, 0.2, 4.0, 1.0, 2.0])
    return rows.T @ rows


CRITERIA = (
    DOptimal(),
    AOptimal(np.array([1.0, 0.01, 3.0, 1.0, 1.0, 2.0])),
    ConditionNumber(),
    Balanced(np.array([0, 1, 3, 4])),
    Discriminating(4, (np.array([4]), np.array([5]))),
    Discriminating(4, (np.array([4, 5]),)),
)


@pytest.mark.parametrize("criterion", CRITERIA, ids=lambda c: c.name)
def test_gradients(criterion, matrix):
    gradient = criterion(matrix)[1]
    rng = np.random.default_rng(1)
    for _ in range(5):
        way = rng.normal(size=matrix.shape)
        way = (way + way.T) * np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
        numeric = (criterion(matrix + 1e-6 * way)[0] - criterion(matrix - 1e-6 * way)[0]) / 2e-6
        assert np.sum(gradient * way) == pytest.approx(numeric, rel=1e-4, abs=1e-6)


def test_d_is_the_log_determinant_of_the_covariance(matrix):
    assert DOptimal()(matrix)[0] == pytest.approx(np.linalg.slogdet(np.linalg.inv(matrix))[1])


def test_a_is_the_log_of_the_mean_relative_variance(matrix):
    unit = np.array([1.0, 0.01, 3.0, 1.0, 1.0, 2.0])
    assert AOptimal(unit)(matrix)[0] == pytest.approx(np.log(np.mean(np.diag(np.linalg.inv(matrix)) / unit)))


def test_condition_does_not_depend_on_units(matrix):
    scale = np.outer(*2 * [np.array([1e3, 1e-3, 1.0, 5.0, 1e2, 1.0])])
    assert condition_number(matrix) == pytest.approx(condition_number(matrix * scale))
    assert condition_number(np.ones((2, 2))) == np.inf


def test_smallest_detectable_size_is_seen_at_the_promised_power():
    rng = np.random.default_rng(3)
    base, effect = rng.normal(size=(60, 3)), rng.normal(size=(60, 1))
    rows = np.hstack([base, effect])
    (size,) = smallest_detectable(rows.T @ rows, 3, (np.array([3]),))
    left = effect[:, 0] - base @ np.linalg.lstsq(base, effect[:, 0], rcond=None)[0]
    draws = (rng.normal(size=(20_000, 60)) + size * effect[:, 0]) @ left / np.linalg.norm(left)
    assert np.mean(draws > 2.326348) == pytest.approx(0.90, abs=0.01)


def test_discriminating_value_is_the_distance_left_by_baseline_and_rival(matrix):
    values = []
    for effect, rival in ((4, 5), (5, 4)):
        known = [0, 1, 2, 3, rival]
        g = matrix
        rest = g[effect, effect] - g[effect, known] @ np.linalg.solve(
            g[np.ix_(known, known)], g[known, effect]
        )
        values.append(np.log(rest))
    soft = Discriminating(4, (np.array([4]), np.array([5])))(matrix)[0]
    assert -min(values) <= soft <= -min(values) + np.log(2) / 4.0 + 1e-9
