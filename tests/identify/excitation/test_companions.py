import numpy as np
import pytest

from identify.excitation.companions import (
    constant_speed_sweeps,
    joined,
    random_points,
    reversed_twin,
    slow_copy,
)
from identify.excitation.errors import DesignError
from identify.excitation.moves_check import move_allowed
from identify.excitation.workspace import Sphere, Workspace


def test_twin_runs_the_same_path_backwards(found):
    t = np.linspace(0.0, 5.0, 101)
    q, qd, qdd = found.series.evaluate(-t)
    twin = reversed_twin(found.series).evaluate(t)
    for value, wanted in zip(twin, (q, -qd, qdd), strict=True):
        np.testing.assert_allclose(value, wanted, atol=1e-12)


def test_slow_copy_visits_the_same_poses(found):
    slow = slow_copy(found.series, 4.0)
    t = np.linspace(0.0, 5.0, 101)
    np.testing.assert_allclose(slow.evaluate(4.0 * t)[0], found.series.evaluate(t)[0], atol=1e-12)
    np.testing.assert_allclose(slow.evaluate(4.0 * t)[2], found.series.evaluate(t)[2] / 16.0, atol=1e-12)
    with pytest.raises(DesignError, match="factor is 1"):
        slow_copy(found.series, 1.0)


@pytest.fixture
def sweeps(found):
    return joined([constant_speed_sweeps(found.limits, joint) for joint in range(2)], found.limits)


@pytest.fixture
def points(found):
    return random_points(found.limits, 3)


@pytest.mark.parametrize("kind", ["sweeps", "points"])
def test_moves_are_smooth_and_inside_the_limits(kind, found, request):
    moves, limits = request.getfixturevalue(kind), found.limits
    t = np.arange(0.0, moves.total_s, 2e-3)
    q, qd, qdd = moves.evaluate(t)
    assert (q >= limits.lower[:, None]).all() and (q <= limits.upper[:, None]).all()
    assert (np.abs(qd) <= limits.velocity[:, None]).all()
    assert (np.abs(qdd) <= limits.acceleration[:, None]).all()
    np.testing.assert_allclose(np.gradient(q, t, axis=1)[:, 1:-1], qd[:, 1:-1], atol=1e-3)
    np.testing.assert_allclose(np.gradient(qd, t, axis=1)[:, 1:-1], qdd[:, 1:-1], atol=0.1)


def test_validation_stops_fully_at_twenty_points(points):
    assert points.points.shape == (21, 2)
    ends = points.pause_s + np.cumsum(points.duration_s + points.pause_s) - points.pause_s
    q, qd, qdd = points.evaluate(np.concatenate([ends, ends + 0.99 * points.pause_s]))
    np.testing.assert_allclose(qd, 0.0, atol=1e-12)
    np.testing.assert_allclose(qdd, 0.0, atol=1e-9)
    np.testing.assert_allclose(q[:, :20], points.points[1:].T, atol=1e-12)


def test_sweeps_hold_each_speed_for_half_the_way(found):
    moves = constant_speed_sweeps(found.limits, 0, speeds=3)
    t = np.arange(0.0, moves.total_s, 1e-3)
    speed = np.abs(moves.evaluate(t)[1][0])
    span = 0.9 * (found.limits.upper[0] - found.limits.lower[0])
    rates = [abs(moves.points[k + 1, 0] - moves.points[k, 0]) for k in range(1, 7)]
    rates = np.unique(np.round(rates / (moves.duration_s[1:] - moves.blend_s[1:]), 9))
    assert len(rates) == 3
    for rate in rates:
        assert np.sum(np.isclose(speed, rate)) * 1e-3 * rate >= 2 * 0.5 * span - 0.01


def test_points_avoid_obstacles(found, problem):
    workspace = Workspace((Sphere(1, np.array([0.0, 0.0, 0.5]), 0.05, "tip"),), floor_m=0.98)
    model, reference = problem.information.model, problem.information.reference

    def allowed(move):
        return move_allowed(model, reference, found.limits, workspace, move)

    free, careful = random_points(found.limits, 3, 20), random_points(found.limits, 3, 20, allowed=allowed)
    assert not allowed(free) and allowed(careful)
    low = Workspace(workspace.spheres, floor_m=5.0)
    with pytest.raises(DesignError, match="None of 200 random points"):
        random_points(
            found.limits, 3, allowed=lambda move: move_allowed(model, reference, found.limits, low, move)
        )
