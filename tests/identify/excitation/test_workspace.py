import numpy as np
import pytest

from identify.excitation.design import DesignOptions, design
from identify.excitation.errors import DesignError
from identify.excitation.feasibility import least_clearances, point_bounds, workspace_violation
from identify.excitation.verify import least_distance_m
from identify.excitation.workspace import (
    Box,
    Sphere,
    Workspace,
    always_meeting,
    clearances,
    distant_pairs,
    urdf_spheres,
)
from identify.kinematics import link_motions, rotate
from identify.urdf import read_urdf

TIP = Sphere(1, np.array([0.1, 0.0, 0.5]), 0.05, "tip")
POST = Sphere(-1, np.array([0.4, 0.1, 0.9]), 0.1, "post")
BOX = Box(np.array([-0.6, -0.5, 0.0]), np.array([-0.3, 0.5, 1.05]), "cabinet")
CROWDED = Workspace((TIP, POST), 0.8, (BOX,), ((0, 1),))


def test_distance_of_a_box_has_the_slope_it_says():
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.5, 1.5, (3, 200))
    far, slope = BOX.distance_m(points)
    for axis in range(3):
        step = np.zeros((3, 1))
        step[axis] = 1e-6
        numeric = (BOX.distance_m(points + step)[0] - BOX.distance_m(points - step)[0]) / 2e-6
        assert np.median(np.abs(numeric - slope[axis])) < 1e-6
    inside = np.all((points > BOX.lower_m[:, None]) & (points < BOX.upper_m[:, None]), axis=0)
    assert inside.any() and ((far < 0) == inside).all()


def test_bounded_clearance_is_below_the_dense_one_and_close_to_it(problem, two_axes):
    for seed in range(5):
        motion = problem.mapping.series(problem.mapping.random(np.random.default_rng(seed)))
        _, bounds = least_clearances(two_axes, CROWDED, motion)
        dense = clearances(two_axes, CROWDED, motion.evaluate(motion.grid_s(50_021))[0]).distance_m.min(
            axis=1
        )
        assert (bounds <= dense + 1e-12).all()
        assert (dense - bounds < 2e-3).all()


def test_two_ways_of_measuring_distances_agree(problem, two_axes):
    q = problem.mapping.series(problem.mapping.random(np.random.default_rng(1))).evaluate(
        np.linspace(0, 5, 500)
    )[0]
    found = clearances(two_axes, CROWDED, q).distance_m.min() + CROWDED.margin_m
    assert least_distance_m(two_axes, CROWDED, q) == pytest.approx(found, abs=1e-12)


def test_no_point_is_accelerated_more_than_its_bound(two_axes):
    rng = np.random.default_rng(3)
    q, qd, qdd = rng.uniform(-1, 1, (3, 2, 500)) * np.array([1.5, 1.2, 5.0])[:, None, None]
    bounds = point_bounds(two_axes, np.abs(qd).max(axis=1), np.abs(qdd).max(axis=1), np.array([0.0, 0.51]))
    link = link_motions(two_axes, q, qd, qdd)[1]
    arm = rotate(link.rotation, TIP.center_m)
    spin = np.cross(link.omega, np.cross(link.omega, arm, axis=0), axis=0)
    acceleration = link.acceleration + np.cross(link.alpha, arm, axis=0) + spin
    assert np.linalg.norm(acceleration, axis=0).max() <= bounds[1]


def test_design_among_obstacles_touches_nothing(two_axes, found):
    options = DesignOptions(harmonics=3, fundamental_hz=0.2, starts=2, refined=1, workspace=CROWDED)
    free = found
    assert workspace_violation(two_axes, CROWDED, free.series) is not None  # the obstacles do bind
    found = design(two_axes, options)
    q = found.series.evaluate(found.series.grid_s(30_011))[0]
    assert least_distance_m(two_axes, CROWDED, q) >= CROWDED.margin_m
    assert found.peaks.clearance_m >= CROWDED.margin_m
    assert found.expected.log_det_covariance > free.expected.log_det_covariance  # and they cost something


def test_impossible_floor_names_its_number(two_axes):
    options = DesignOptions(harmonics=2, starts=1, workspace=Workspace((TIP,), floor_m=3.0))
    with pytest.raises(DesignError, match=r"tip and the floor reaches -.* m, but 0\.01 m is the limit"):
        design(two_axes, options)


def test_spheres_of_a_urdf_and_pairs():
    chain_text = """<robot name="r">
    <link name="b"><collision><geometry><sphere radius="0.2"/></geometry></collision></link>
    <link name="l1"><collision>
    <origin xyz="0 0 0.1"/><geometry><sphere radius="0.1"/></geometry></collision></link>
    <link name="l2"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
    <link name="f"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
    <joint name="j1" type="continuous"><parent link="b"/><child link="l1"/><axis xyz="0 0 1"/></joint>
    <joint name="j2" type="continuous"><parent link="l1"/><child link="l2"/>
    <origin xyz="0 0 1"/><axis xyz="0 1 0"/></joint>
    <joint name="j3" type="fixed"><parent link="l2"/><child link="f"/>
    <origin xyz="0 0 0.5"/></joint></robot>"""
    spheres = urdf_spheres(chain_text, read_urdf(chain_text))
    assert [(s.link, s.radius_m, s.name) for s in spheres] == [(-1, 0.2, "b"), (0, 0.1, "l1"), (1, 0.05, "f")]
    np.testing.assert_allclose(spheres[2].center_m, [0, 0, 0.5])
    assert distant_pairs(spheres) == ((0, 2),)


def test_pairs_that_always_overlap_are_found(two_axes):
    spheres = (Sphere(-1, np.zeros(3), 2.0, "big"), TIP, POST)
    assert always_meeting(two_axes, spheres, ((0, 1), (1, 2))) == ((0, 1),)
