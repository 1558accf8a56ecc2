"""The family's own null distribution, against brute force."""

import itertools

import numpy as np

from identify.diagnosis.candidates import Trial, log_chance
from identify.diagnosis.null import FamilyNull, family_null
from identify.physics.catalogue import catalogue
from identify.physics.effect import Place


def _trials(rng, count, rows=400):
    effect = catalogue()["plate_time_skew"]  # one coefficient of either sign
    for _ in range(count):
        column = rng.normal(size=(rows, 1))
        column /= np.linalg.norm(column)
        yield Trial(effect, Place(), {}, np.array([0]), column, np.eye(1), 0.0, np.zeros(1), np.ones(1))


def test_the_family_probability_is_right_for_independent_candidates():
    rng = np.random.default_rng(0)
    trials = list(_trials(rng, 60))
    null = family_null(trials, rng)
    assert 35 < null.effective < 110
    stacked = np.hstack([t.basis for t in trials])
    best = np.array([np.max((stacked.T @ rng.normal(size=400)) ** 2) for _ in range(1500)])
    p = np.array([null.p_value(float(log_chance(np.array(b), 1))) for b in best])
    assert abs(np.mean(p < 0.05) - 0.05) < 0.03
    assert abs(np.mean(p < 0.5) - 0.5) < 0.12


def test_copies_of_one_candidate_count_once():
    rng = np.random.default_rng(1)
    one = next(_trials(rng, 1))
    assert family_null([one] * 30, rng).effective < 1.3


def test_probabilities_stay_ordered_where_they_underflow():
    null = FamilyNull(50.0)
    p = [null.p_value(float(log_chance(np.array(g), 2))) for g in (10.0, 100.0, 500.0, 1200.0)]
    assert all(a > b > 0.0 for a, b in itertools.pairwise(p))
    np.testing.assert_allclose(log_chance(np.array([5.0, 50.0, 800.0]), 1)[:2], [-3.67597, -26.9], rtol=0.02)
