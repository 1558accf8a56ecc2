"""The measured motion as lines: at the samples' own instants, as many lines as stand out of the noise."""

from dataclasses import replace

import numpy as np
import pytest

from identify.blocks import periodic_rows
from identify.dataset import Signal
from identify.filters import AntiAliasFilter
from identify.fourier import fit_trajectory, unfiltered
from identify.period import PeriodWindow
from tests.identify import synthetic

WINDOW = PeriodWindow(4.0, 0.0, 8, False)


def measured(motion, clock, noise=0.0, seed=0, rate=100.0):
    rng = np.random.default_rng(seed)
    t = clock.instants(32.0, rate, rng)
    q = motion(t)[0]
    return Signal(t, q + noise * rng.standard_normal(q.shape))


@pytest.mark.parametrize(
    "clock",
    [
        synthetic.Clock(),
        synthetic.Clock(ppm=120.0, phase_s=1.7e-3),
        synthetic.Clock(jitter_s=1e-3),
        synthetic.Clock(loss=0.05),
        synthetic.Clock(gap=(9.3, 10.1)),
        synthetic.Clock(ppm=-80.0, phase_s=3e-3, jitter_s=5e-4, loss=0.02, gap=(3.0, 3.4)),
    ],
)
def test_lines_are_exact_at_the_samples_own_instants(clock):
    motion = synthetic.fourier_motion(3, seed=5)
    found = fit_trajectory(measured(motion, clock), WINDOW, 5)
    t = np.linspace(0.0, 4.0, 500)
    for ours, true, size in zip(found.evaluate(t), motion(t), (1e-9, 1e-8, 1e-6), strict=True):
        assert np.abs(ours - true).max() < size


def test_lines_the_controller_adds_are_kept_and_noise_is_not():
    motion = synthetic.fourier_motion(2, seed=1)
    position = measured(motion, synthetic.Clock(), noise=1e-4)
    extra = 5e-4 * np.sin(2 * np.pi * 0.25 * 23 * position.t_s)
    found = fit_trajectory(Signal(position.t_s, position.values + extra), WINDOW, 5)
    # a line of pure noise is kept in one run of a thousand
    assert set(found.lines.tolist()) == {1, 2, 3, 4, 5, 23}
    np.testing.assert_allclose(found.noise_std, 1e-4, rtol=0.08)


def test_velocity_and_acceleration_have_the_stated_std():
    motion, t = synthetic.fourier_motion(1, seed=2), np.linspace(0, 4, 200)
    errors = []
    for seed in range(120):
        found = fit_trajectory(measured(motion, synthetic.Clock(), noise=1e-4, seed=seed), WINDOW, 5)
        ours, true = found.evaluate(t), motion(t)
        errors.append([np.mean((ours[k] - true[k]) ** 2) for k in (1, 2)])
    expected = [found.velocity_std[0], found.acceleration_std[0]]
    np.testing.assert_allclose(np.sqrt(np.mean(errors, axis=0)), expected, rtol=0.1)


def test_derivatives_are_those_of_the_positions():
    found = fit_trajectory(measured(synthetic.fourier_motion(2), synthetic.Clock()), WINDOW, 5)
    t, step = np.linspace(0.5, 3.5, 50), 1e-5
    ahead, behind = found.evaluate(t + step), found.evaluate(t - step)
    for order in (0, 1):
        rate = (ahead[order] - behind[order]) / (2 * step)
        np.testing.assert_allclose(rate, found.evaluate(t)[order + 1], atol=1e-6)


def test_an_encoder_filter_is_undone_line_by_line():
    motion = synthetic.fourier_motion(2)
    anti_alias = AntiAliasFilter(order=4, cutoff_hz=8.0)
    lines = fit_trajectory(measured(motion, synthetic.Clock()), WINDOW, 5)
    gain = anti_alias.response(lines.lines / 4.0)
    wave = (lines.cosine - 1j * lines.sine) * gain
    back = unfiltered(replace(lines, cosine=wave.real, sine=-wave.imag), anti_alias)
    np.testing.assert_allclose(back.cosine, lines.cosine, atol=1e-12)
    np.testing.assert_allclose(back.sine, lines.sine, atol=1e-12)


def test_the_papers_filter_delays_by_20_4_ms():
    assert AntiAliasFilter(order=8, cutoff_hz=40.0).delay_at_zero_s == pytest.approx(20.4e-3, abs=5e-5)


def test_averaged_rows_stand_at_the_mean_of_their_samples_instants():
    """A plate with its own clock: its averaged rows give its averaged readings, nothing interpolated."""
    run = synthetic.noise_free(plate_clock=synthetic.Clock(ppm=60.0, phase_s=4e-3, jitter_s=1e-3, loss=0.01))
    window = PeriodWindow(4.0, 0.0, 8, False)
    trajectory = fit_trajectory(run.data.position, window, 5)
    block = periodic_rows(run.model, run.data, window, trajectory).blocks[0]
    factors = np.where(block.joint >= 0, run.scale[np.maximum(block.joint, 0)], 1.0)
    predicted = factors[:, None] * (np.einsum("cpn,p->cn", block.columns, run.theta) + block.known)
    size = np.abs(block.target).max(axis=1, keepdims=True)
    assert np.abs(np.where(block.usable, predicted - block.target, 0.0) / size).max() < 1e-6
    assert block.usable.mean() > 0.97
