import numpy as np
import pytest

from identify.excitation.bounds import series_extremes
from identify.excitation.mapping import smooth_motion


@pytest.mark.parametrize("seed", range(8))
def test_every_x_is_a_feasible_motion_that_uses_its_limits(problem, seed):
    mapping, limits = problem.mapping, problem.mapping.limits
    motion = mapping.series(mapping.random(np.random.default_rng(seed)))
    low, high = series_extremes(motion, 0)
    fast = np.max(np.abs(series_extremes(motion, 1)), axis=0)
    hard = np.max(np.abs(series_extremes(motion, 2)), axis=0)
    assert (low >= limits.lower).all() and (high <= limits.upper).all()
    assert (fast <= limits.velocity).all() and (hard <= limits.acceleration).all()
    room = (high - low) / (limits.upper - limits.lower)
    used = np.maximum(np.maximum(fast / limits.velocity, hard / limits.acceleration), room)
    assert (used > 0.998).all()


@pytest.mark.parametrize("seed", range(4))
def test_smooth_motion_is_feasible_on_its_grid(problem, seed):
    mapping, limits = problem.mapping, problem.mapping.limits
    motion = smooth_motion(mapping, mapping.random(np.random.default_rng(seed)), 30.0)
    assert (motion.q >= limits.lower[:, None]).all() and (motion.q <= limits.upper[:, None]).all()
    assert (np.abs(motion.qd) <= limits.velocity[:, None]).all()
    assert (np.abs(motion.qdd) <= limits.acceleration[:, None]).all()


def test_gradient_of_the_mapping(problem):
    mapping = problem.mapping
    rng = np.random.default_rng(2)
    x = mapping.random(rng)
    x.reshape(2, -1)[:, -1] = 0.8
    bars = rng.normal(size=(3, 2, mapping.waves.q.shape[1]))

    def weighted(z):
        motion = smooth_motion(mapping, z, 20.0)
        return sum(
            np.sum(bar * part) for bar, part in zip(bars, (motion.q, motion.qd, motion.qdd), strict=True)
        )

    found = smooth_motion(mapping, x, 20.0).pull_back(*bars)
    steps = 1e-6 * np.eye(len(x))
    wanted = np.array([(weighted(x + step) - weighted(x - step)) / 2e-6 for step in steps])
    np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-5 * np.abs(wanted).max())


def test_warm_start_recovers_the_motion(problem):
    mapping = problem.mapping
    motion = mapping.series(mapping.random(np.random.default_rng(5)))
    again = mapping.series(mapping.x_of(motion))
    for part in ("offset", "cosine", "sine"):
        np.testing.assert_allclose(getattr(again, part), getattr(motion, part), atol=1e-5)
