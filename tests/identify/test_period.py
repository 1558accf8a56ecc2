"""Periods: found where they are, refused where they are not."""

from dataclasses import replace

import numpy as np
import pytest

from identify.dataset import RunFacts, Signal
from identify.errors import NotPeriodicError
from identify.fit import FitOptions, fit
from identify.period import find_window, infer_period
from tests.identify import synthetic

NAMES = ("j0", "j1")


@pytest.fixture(scope="module")
def truth():
    return synthetic.noise_free()


def unstated(data):
    return replace(data, facts=RunFacts(), kind="")


def test_the_period_is_inferred_where_nothing_is_stated(truth):
    window = find_window(unstated(truth.data), NAMES)
    assert window.inferred
    assert window.period_s == pytest.approx(4.0, abs=2e-5)
    assert window.periods == 8


def test_the_shortest_common_period_is_found_not_a_multiple():
    data = synthetic.noise_free(
        periods=12, motion=synthetic.fourier_motion(2, seed=3, fundamental_hz=0.4)
    ).data
    assert infer_period(data.position) == pytest.approx(2.5, abs=2e-5)


def test_encoder_noise_jitter_and_losses_do_not_hide_the_period(truth):
    clock = synthetic.Clock(jitter_s=1e-3, loss=0.01)
    run = synthetic.noise_free(joint_clock=clock)
    noisy = synthetic.with_noise(run, np.random.default_rng(0), encoder=1e-4)
    assert find_window(unstated(noisy), NAMES).period_s == pytest.approx(4.0, abs=2e-3)


def test_a_period_only_some_joints_have_is_not_inferred(truth):
    data = unstated(truth.data)
    values = data.position.values.copy()
    values[1] += 0.3 * np.sin(2 * np.pi * 0.0917 * data.position.t_s)
    wrong = replace(data, position=Signal(data.position.t_s, values))
    with pytest.raises(NotPeriodicError, match=r"joints j0 repeat after 4 s, but j1 do not"):
        find_window(wrong, NAMES)
    result = fit(truth.model.robot, wrong, FitOptions(kind="internal"))
    assert result.window is None
    assert result.lack_of_fit.p is None
    assert any("j0 repeat after 4 s" in text for text in result.warnings)


@pytest.mark.parametrize("wrong_hz", [0.2, 0.26, 0.31])
def test_a_wrong_fundamental_is_refused_with_the_right_one(truth, wrong_hz):
    data = replace(truth.data, facts=replace(truth.data.facts, fundamental_hz=wrong_hz))
    with pytest.raises(NotPeriodicError, match=r"fundamental_hz = 0\.25"):
        find_window(data, NAMES)


def test_fewer_than_two_periods_are_refused(truth):
    short = replace(truth.data, position=truth.data.position.between(0.0, 6.5))
    with pytest.raises(NotPeriodicError, match="two"):
        find_window(short, NAMES)


def test_transients_are_left_out(truth):
    data = truth.data
    values = data.position.values + 0.3 * np.exp(-data.position.t_s / 0.8)
    settled = replace(
        data,
        position=Signal(data.position.t_s, values),
        facts=replace(data.facts, transient_periods=1, periods=7),
    )
    window = find_window(settled, NAMES)
    assert window.start_s >= 2.0
    assert 5 <= window.periods <= 7
    assert window.stop_s <= data.position.t_s[-1] + 0.05


def test_a_resting_robot_is_refused(truth):
    still = Signal(truth.data.position.t_s, np.zeros_like(truth.data.position.values))
    with pytest.raises(NotPeriodicError, match="no joint moves"):
        find_window(replace(unstated(truth.data), position=still), NAMES)


def test_all_whole_periods_are_used():
    for periods in (2, 3, 5):
        run = synthetic.noise_free(periods=periods)
        assert find_window(run.data, NAMES).periods == periods
