"""Do the stated uncertainties hold? Repeats with fresh noise against the Cramer-Rao bound and coverage."""

import numpy as np
import pytest
from scipy import stats

from identify.fit import FitOptions, fit
from tests.identify import synthetic

REPEATS = 36


@pytest.fixture(scope="module")
def run():
    return synthetic.noise_free(periods=6, rate_hz=40.0, plate_clock=synthetic.Clock(ppm=40.0, phase_s=4e-3))


def repeats(run, ar1, correlation, estimator="markov", **noise):
    """Errors over stated std (repeats, P), and stated std (repeats, P)."""
    errors, stated = [], []
    for seed in range(REPEATS):
        data = synthetic.with_noise(run, np.random.default_rng([7, seed]), ar1, correlation, **noise)
        found = fit(run.model.robot, data, FitOptions(estimator=estimator), model=run.model)
        assert found.intervals_valid or found.lack_of_fit.p < 0.01
        std = np.sqrt(np.diag(found.covariance))
        constants = [k.value for k in found.torque_constants]
        errors.append(np.concatenate([found.theta - run.theta, constants - run.constants]) / std)
        stated.append(std)
    return np.array(errors), np.array(stated)


@pytest.mark.parametrize(
    ("ar1", "correlation", "estimator"), [(0.0, 0.0, "markov"), (0.6, 0.3, "markov"), (0.6, 0.3, "ols")]
)
def test_stated_std_and_intervals_hold(run, ar1, correlation, estimator):
    z, _ = repeats(run, ar1, correlation, estimator)
    # the mean square of P correlated errors over 36 repeats scatters by some 6 %
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.12)
    coverage = np.mean(np.abs(z) < stats.norm.ppf(0.975))
    assert 0.90 < coverage < 0.985
    worst = np.abs(z.mean(axis=0)) * np.sqrt(REPEATS)
    assert worst.max() < 4.0  # no parameter is biased


def test_std_is_the_cramer_rao_bound(run):
    from identify.blocks import periodic_rows
    from identify.fourier import fit_trajectory
    from identify.noise import NoiseModel
    from identify.period import find_window
    from identify.solve import solve

    window = find_window(run.data, run.model.robot.joint_names)
    rows = periodic_rows(run.model, run.data, window, fit_trajectory(run.data.position, window, 5))
    size = np.concatenate([np.full(2, synthetic.JOINT_NOISE) * run.scale, synthetic.WRENCH_NOISE])
    true = NoiseModel(tuple(np.ones(1) for _ in size), np.diag(size**2), size, 1e9, True)
    bound = solve(rows.blocks, [true], 2, np.arange(2), (run.theta, run.scale)).covariance
    constants = np.array([j.drive.torque_constant for j in run.model.robot.joints]) / run.scale**2
    expected = np.sqrt(np.diag(bound)) * np.concatenate([np.ones(len(run.theta)), constants])
    _, stated = repeats(run, 0.0, 0.0)
    np.testing.assert_allclose(stated.mean(axis=0), expected, rtol=0.05)


def test_ordinary_least_squares_is_never_better(run):
    _, markov = repeats(run, 0.6, 0.3)
    _, plain = repeats(run, 0.6, 0.3, "ols")
    ratio = plain.mean(axis=0) / markov.mean(axis=0)
    assert ratio.min() > 0.97
    assert ratio.max() > 1.1


def test_maximum_likelihood_is_markov_with_noiseless_encoders(run):
    data = synthetic.with_noise(run, np.random.default_rng(3), encoder=0.0)
    markov = fit(run.model.robot, data, model=run.model)
    likely = fit(run.model.robot, data, FitOptions(estimator="ml"), model=run.model)
    np.testing.assert_allclose(likely.theta, markov.theta, atol=1e-4 * markov.std.max())
    np.testing.assert_array_less(np.abs(likely.theta - markov.theta), 1e-3 * markov.std)
    np.testing.assert_allclose(likely.std, markov.std, rtol=1e-3)


def test_maximum_likelihood_allows_for_noisy_encoders(run):
    """With coarse encoders the trajectory errs by more than the torques' noise: only ML then holds."""
    data = [synthetic.with_noise(run, np.random.default_rng([5, k]), encoder=1e-3) for k in range(8)]
    z = {}
    for estimator in ("markov", "ml"):
        fits = [fit(run.model.robot, d, FitOptions(estimator=estimator), model=run.model) for d in data]
        z[estimator] = np.sqrt(
            np.mean(
                [
                    ((f.theta - run.theta) / np.sqrt(np.diag(f.solution.covariance))[: len(run.theta)]) ** 2
                    for f in fits
                ]
            )
        )
    assert z["ml"] < 1.5
    assert z["ml"] < z["markov"]
