"""Noise from repeats: size, colour, covariance between channels."""

import numpy as np
import pytest
from scipy import stats

from identify.fit import fit
from identify.noise import autoregression, noise_from_scatter
from tests.identify import synthetic


def scatter(series, periods):
    """Deviation from the mean of the periods, (c, M, N)."""
    table = series.reshape(len(series), periods, -1)
    return table - table.mean(axis=1, keepdims=True)


def test_the_divisor_is_unbiased():
    """With two periods half of the variance goes into the mean: the paper's MN - 1 would be off by two."""
    rng, found = np.random.default_rng(0), []
    for _ in range(60):
        table = scatter(synthetic.coloured(rng, np.array([2.0, 5.0]), 400), 2)
        found.append(noise_from_scatter(table, 200.0).std ** 2)
    np.testing.assert_allclose(np.mean(found, axis=0), [4.0, 25.0], rtol=0.06)


@pytest.mark.parametrize("ar1", [0.0, 0.6, -0.4])
def test_colour_and_covariance_are_found(ar1):
    rng = np.random.default_rng(1)
    series = synthetic.coloured(rng, np.array([1.0, 3.0, 0.5]), 8000, ar1, 0.4)
    model = noise_from_scatter(scatter(series, 8), 7000.0)
    np.testing.assert_allclose(model.std, [1.0, 3.0, 0.5], rtol=0.05)
    correlation = model.innovation / np.sqrt(np.outer(np.diag(model.innovation), np.diag(model.innovation)))
    np.testing.assert_allclose(correlation[np.triu_indices(3, 1)], 0.4, atol=0.05)
    for taps in model.filters:
        assert (taps[1] if len(taps) > 1 else 0.0) == pytest.approx(-ar1, abs=0.05)
    # power at zero frequency: a mean's variance is that of white noise times (1 + a) / (1 - a)
    expected = np.array([1.0, 9.0, 0.25]) * (1 + ar1) / (1 - ar1)
    np.testing.assert_allclose(model.spectrum_at_zero(), expected, rtol=0.15)


def test_white_noise_stays_white():
    rng = np.random.default_rng(5)
    orders = [len(autoregression(rng.standard_normal((8, 500)))) - 1 for _ in range(30)]
    assert np.mean(np.array(orders) == 0) > 0.9


def test_whitened_noise_is_white_and_of_unit_covariance():
    rng = np.random.default_rng(2)
    series = synthetic.coloured(rng, np.array([1.0, 3.0]), 16000, 0.7, 0.5)
    model = noise_from_scatter(scatter(series, 8), 14000.0)
    white = model.whiten(scatter(series, 8)[:, 0])
    assert np.abs(np.cov(white) - np.eye(2)).max() < 0.2
    lagged = np.mean(white[:, 1:] * white[:, :-1], axis=1)
    assert np.abs(lagged).max() < 0.08


def test_simulated_noise_has_the_models_covariance():
    rng = np.random.default_rng(3)
    model = noise_from_scatter(
        scatter(synthetic.coloured(rng, np.array([1.0, 2.0]), 8000, 0.5, 0.3), 8), 7000.0
    )
    drawn = np.concatenate([model.simulate(rng, 1000) for _ in range(40)], axis=1)
    np.testing.assert_allclose(drawn.std(axis=1), model.std, rtol=0.05)


def test_colour_adjoint_is_the_transpose_of_the_root():
    """x' S x by the adjoint equals the variance of x' e over drawn noise."""
    rng = np.random.default_rng(4)
    model = noise_from_scatter(
        scatter(synthetic.coloured(rng, np.array([1.0, 2.0]), 4000, 0.6, 0.3), 8), 3500.0
    )
    x = rng.standard_normal((2, 1, 200))
    expected = np.sum(model.colour_adjoint(x) ** 2)
    drawn = [np.sum(x[:, 0] * model.simulate(rng, 200)) for _ in range(3000)]
    assert np.var(drawn) == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(("ar1", "correlation"), [(0.0, 0.0), (0.6, 0.3)])
def test_the_lack_of_fit_probability_is_uniform_when_the_model_holds(ar1, correlation):
    plate = synthetic.Clock(ppm=40.0, phase_s=4e-3)
    run = synthetic.noise_free(periods=6, rate_hz=40.0, plate_clock=plate)
    found = []
    for seed in range(40):
        data = synthetic.with_noise(run, np.random.default_rng(seed), ar1, correlation)
        found.append(fit(run.model.robot, data, model=run.model).lack_of_fit.p)
    assert stats.kstest(found, "uniform").pvalue > 0.01
