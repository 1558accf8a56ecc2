"""Springs, geometry, outside forces, plate and timing, against a robot whose physics is its own."""

import string
from functools import cache

import numpy as np
import pytest

from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.effects.scales import tip
from drivers.virtual.plant_file import load_plant
from drivers.virtual.record import record_virtual
from drivers.virtual.rigid import RigidPlant
from drivers.virtual.robot_description import robot_toml
from drivers.virtual.trajectories import random_fourier
from identify.diagnosis.between import progressive_tests
from identify.diagnosis.candidates import trial
from identify.diagnosis.problem import build_problem
from identify.fit import Fit, FitOptions, fit
from identify.physics.catalogue import effect_named
from identify.physics.effect import Place
from identify.physics.outside import distal_axes
from identify.physics.responses import delayed, lagging, resonant
from service.datasets import dataset_of
from service.robots import build_robot
from tests.identify.physics.joint_recordings import PLANT, ROBOT, estimate, model, scene_of

_NOISE = PLANT.noise
# a fifth of the reference robot's noise: plate and geometry are what a short run shows least of
QUIET = PLANT.model_copy(
    update={
        "noise": _NOISE.model_copy(
            update={
                "joint_torque_nm": tuple(0.2 * x for x in _NOISE.joint_torque_nm),
                "wrench": tuple(0.2 * x for x in _NOISE.wrench),
            }
        )
    }
)
REACH, ASIDE, ACROSS = tip(PLANT)[1][[2, 0, 1]]
# the virtual springs' crank: hypotenuse, shortest rod [m]
_H, _SHORT = float(np.hypot(0.40, 0.08)), 0.32
_TURN, _ARM, _E = 0.02, 0.02, 0.008


def recorded(*effects: EffectSpec, periods: int = 4, kind: str = "combined") -> Fit:
    run = record_virtual(QUIET, random_fourier(QUIET, 7), periods, 1, seed=3, effects=effects)
    return fit(ROBOT.robot, dataset_of(run, ROBOT), FitOptions(), model(kind))


@cache
def null() -> Fit:
    return recorded()


# effect, place, what the virtual robot gets, shape, coefficients that must come out (nan: not asked for)
STEADY = [
    (
        "gravity_compensation_spring", Place(0), {"stiffness_n_m": 300.0, "phase_rad": 0.4}, {"phi": 0.4},
        [300.0 * _H * (_SHORT - 0.2), 300.0 * _H**2],
    ),
    (
        "gravity_compensation_spring", Place(2), {"stiffness_n_m": 60.0, "phase_rad": -0.3}, {"phi": -0.3},
        [60.0 * _H * (_SHORT - 0.2), 60.0 * _H**2],
    ),
    (
        "gas_balancer", Place(1), {"force_n": 1200.0, "heat_time_s": 2.0}, {"heat_time": 2.0, "phi": 0.0},
        [1200.0 * _H, np.nan],
    ),
    (
        "cable_stiffness", Place(2), {"stiffness_nm_rad": 1.5, "cubic_nm_rad3": 1.0, "rest_rad": 0.0}, {},
        [1.5, 1.0],
    ),
    (
        "external_hose", Place(), {"stiffness_n_m": 8.0, "anchor_x_m": 0.3},
        {"reach": REACH, "aside": ASIDE, "across": ACROSS}, [8.0, np.nan, np.nan, np.nan],
    ),
    ("air_drag", Place(0), {"coefficient_nm_s2": 2.0}, {}, [2.0]),
    ("air_drag", Place(2), {"coefficient_nm_s2": 1.0}, {}, [1.0]),
    ("joint_zero_offset", Place(1), {"offset_rad": 0.04}, {}, [0.04]),
    ("link_geometry_error", Place(1), {"length_m": 0.02, "axis": 0}, {}, [0.02, np.nan, 0.0]),
    ("link_geometry_error", Place(2), {"length_m": 0.02, "axis": 2}, {}, [0.0, np.nan, 0.02]),
    (
        "base_tilt", Place(), {"angle_rad": _TURN, "azimuth_rad": 0.7}, {},
        [-_TURN * np.cos(0.7), -_TURN * np.sin(0.7)],
    ),
    (
        "link_vibration", Place(0), {"share": 1.0, "frequency_hz": 4.0, "damping": 0.05},
        {"f0": 4.0, "damping": 0.05}, [1.0],
    ),
    ("plate_gain_error", Place(channel="force.x"), {"share": 0.03}, {}, [0.03]),
    ("plate_gain_error", Place(channel="torque.z"), {"share": -0.03}, {}, [-0.03]),
    ("plate_crosstalk", Place(channel="torque.x->torque.z"), {"coefficient": 0.02}, {}, [0.02]),
    ("plate_crosstalk", Place(channel="force.x->force.y"), {"coefficient": -0.03}, {}, [-0.03]),
    (
        "plate_origin_offset", Place(), {"distance_m": _ARM, "azimuth_rad": 0.7, "elevation_rad": 0.5}, {},
        [_ARM * np.cos(0.5) * np.cos(0.7), _ARM * np.cos(0.5) * np.sin(0.7), _ARM * np.sin(0.5)],
    ),
    ("plate_yaw_misalignment", Place(), {"angle_rad": _TURN}, {}, [_TURN]),
    ("plate_high_pass", Place(), {"corner_rad_s": 0.02}, {}, [0.02]),
    (
        "platform_compliance", Place(), {"inverse_square_s2": 1e-4, "damping": 0.1}, {},
        [1e-4, 2.0 * 0.1 * 1e-2],
    ),
    ("plate_time_skew", Place(), {"skew_s": 4e-3}, {}, [4e-3]),
    ("encoder_time_skew", Place(), {"skew_s": 4e-3}, {"late": 4e-3}, [4e-3, np.nan]),
    (
        "encoder_eccentricity", Place(1), {"amplitude_rad": _E, "phase_rad": 0.5}, {"turns": 0.0},
        [_E * np.cos(0.5), _E * np.sin(0.5)],
    ),
    (
        "encoder_eccentricity", Place(0), {"amplitude_rad": _E, "phase_rad": 2.0}, {"turns": 0.0},
        [_E * np.cos(2.0), _E * np.sin(2.0)],
    ),
]
PROGRESSIVE = ["plate_drift", "clock_drift"]
NAMES = sorted({case[0] for case in STEADY} | set(PROGRESSIVE) | {"external_contact", "payload"})


def _spec(name, place, true):
    return EffectSpec(name, None if place.joint is None else f"joint_{place.joint + 1}", place.channel, true)


def _middle(effect):
    return {shape.name: shape.grid[len(shape.grid) // 2] for shape in effect.shapes}


def _id(case):
    place = case[1]
    return f"{case[0]}-{place.channel or place.joint}"


@pytest.mark.parametrize(("name", "place", "true", "shape", "expected"), STEADY, ids=map(_id, STEADY))
def test_recovers_an_effect_of_the_virtual_robot(name, place, true, shape, expected):
    effect = effect_named(name)
    fitted = recorded(_spec(name, place, true))
    got = estimate(fitted, effect, place, shape)
    asked = np.isfinite(expected)
    error = (got.values - expected)[asked]
    assert (np.abs(error) < 3.5 * got.std[asked]).all(), (got.values, expected, got.std)
    if got.gain > 5000.0:  # then a tenth is far beyond noise
        assert np.linalg.norm(error) < 0.1 * np.linalg.norm(np.array(expected)[asked])
    assert got.gain > 12.0
    assert place in effect.places(scene_of(fitted))
    assert effect.allowed(scene_of(fitted), place, np.nan_to_num(got.values), shape)


def test_a_hose_hangs_where_it_was_hung():
    fitted = recorded(EffectSpec("external_hose", parameters={"stiffness_n_m": 8.0, "anchor_x_m": 0.3}))
    scene, shape = scene_of(fitted), {"reach": REACH, "aside": ASIDE, "across": ACROSS}
    got = estimate(fitted, effect_named("external_hose"), Place(), shape)
    rigid, (link, point_m) = RigidPlant(PLANT), tip(PLANT)
    anchor = rigid.point(np.zeros(3), link, point_m) + np.array([0.3, 0.0, 0.4])
    held = np.mean([anchor - rigid.point(q, link, point_m) for q in scene.q.T[::5]], axis=0)
    assert (np.abs(got.values[1:] - 8.0 * held) < 4.0 * got.std[1:]).all()


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_push_is_found_in_its_place_and_direction(joint):
    true = {"force_n": 6.0, "angle_rad": 0.1, "width_rad": 0.2, "azimuth_rad": 0.6}
    fitted = recorded(EffectSpec("external_contact", f"joint_{joint + 1}", None, true))
    effect = effect_named("external_contact")
    q = scene_of(fitted).q[joint]
    shape = {"centre": (0.1 - q.min()) / np.ptp(q), "width": 0.2, "reach": REACH}
    got = estimate(fitted, effect, Place(joint), shape)
    expected = 6.0 * np.array([0.8 * np.cos(0.6), 0.8 * np.sin(0.6), 0.6])
    assert got.gain > 500.0
    assert np.linalg.norm(got.values - expected) < 0.15 * 6.0  # the tool's few cm across are not modelled
    others = [estimate(fitted, effect, Place(k), shape).gain for k in range(3) if k != joint]
    assert max(others) < 0.5 * got.gain


@pytest.mark.parametrize("name", ["plate_drift", "clock_drift"])
def test_recovers_what_changes_during_the_run(name):
    channel = "force.y" if name == "plate_drift" else None
    true = {"slope": 0.03} if name == "plate_drift" else {"rate_ppm": 80.0}
    problem = build_problem(recorded(EffectSpec(name, None, channel, true), periods=6))
    tests = progressive_tests(problem, [effect_named(n) for n in PROGRESSIVE])
    best = max((t for t in tests if t.course == "ramp"), key=lambda item: item.gain)
    expected = 0.03 if name == "plate_drift" else 80e-6
    assert (best.effect.name, best.place.channel) == (name, channel)
    assert best.p_value < 1e-6
    assert abs(best.values[0] - expected) < 3.5 * best.std[0]


@cache
def _null_problem():
    return build_problem(null())


def test_absent_effects_are_within_their_noise():
    problem, worst = _null_problem(), []
    for name in sorted({case[0] for case in STEADY}):
        effect = effect_named(name)
        for place in effect.places(problem.scene):
            shape = _middle(effect)
            found = trial(problem, problem.basis, problem.residual, effect, place, shape)
            if found is not None and found.gain > 0.0:
                worst.append(found.gain / len(found.kept))
    assert len(worst) > 25
    assert 0.2 < np.median(worst) < 2.5  # neither biased nor with inflated errors
    assert max(worst) < 20.0


@pytest.mark.parametrize("name", NAMES)
def test_columns_stand_only_where_the_effect_acts(name):
    scene, effect = scene_of(null()), effect_named(name)
    n = scene.robot.n
    for place in effect.places(scene):
        columns = effect.columns(scene, place, _middle(effect))
        assert columns.shape == (scene.rows, len(effect.coefficients), len(scene.t_s))
        assert np.isfinite(columns).all()
        energy = np.sum(columns**2, axis=(1, 2))
        if name == "external_contact" and not energy.any():
            continue  # the middle of the joint's travel may not be passed
        assert (energy[:n].sum() > 0.0) == (effect.where in "IB" or name.startswith("encoder"))
        assert (energy[n:].sum() > 0.0) == (effect.where in "BPS")
        if effect.where == "I":
            assert not np.delete(energy, place.joint).any()


@pytest.mark.parametrize("name", NAMES)
def test_sentences_name_their_place_and_numbers(name):
    effect = effect_named(name)
    known = {"place"} | {c.name for c in effect.coefficients} | {s.name for s in effect.shapes}
    used = {field for _, field, _, _ in string.Formatter().parse(effect.sentence) if field}
    assert used <= known
    assert effect.coefficients[0].name in used
    somewhere = effect.places(scene_of(null()))
    assert ("place" in used) == any(p.joint is not None or p.channel is not None for p in somewhere)
    assert effect.reference


@pytest.mark.parametrize(
    ("name", "place", "values", "shape"),
    [
        ("gravity_compensation_spring", Place(0), [-1.0, 1.0], {"phi": 0.0}),
        ("gas_balancer", Place(0), [0.0, 1.0], {"phi": 0.0, "heat_time": 1.0}),
        ("cable_stiffness", Place(0), [-1.0, 0.0], {}),
        ("external_hose", Place(), [-1.0, 0.0, 0.0, 0.0], {}),
        ("air_drag", Place(0), [-1.0], {}),
        ("base_tilt", Place(), [0.5, 0.5], {}),
        ("link_vibration", Place(0), [5.0], {}),
        ("plate_gain_error", Place(channel="force.x"), [-1.5], {}),
        ("plate_yaw_misalignment", Place(), [1.0], {}),
        ("plate_high_pass", Place(), [-0.01], {}),
        ("platform_compliance", Place(), [-1e-4, 1e-3], {}),
        ("platform_compliance", Place(), [0.0, 5e-3], {}),
        ("encoder_time_skew", Place(), [2e-3, 0.0], {"late": 2e-3}),
        ("encoder_time_skew", Place(), [-5e-3, 1.0], {"late": 2e-3}),
    ],
)
def test_refuses_values_that_are_not_physical(name, place, values, shape):
    assert not effect_named(name).allowed(scene_of(null()), place, np.array(values), shape)


def test_nothing_of_the_plate_is_tried_without_one():
    scene = scene_of(recorded(kind="internal"))
    for name in NAMES:
        effect = effect_named(name)
        places = effect.places(scene)
        if effect.where == "P" or name in ("plate_time_skew", "clock_drift", "payload", "base_tilt"):
            assert places == []
        for place in places:
            assert effect.columns(scene, place, _middle(effect)).shape[0] == scene.robot.n


@pytest.mark.parametrize("turns", [0.0, 1.0])
def test_an_eccentric_disk_moves_arm_and_motor(turns):
    scene, effect = scene_of(null()), effect_named("encoder_eccentricity")
    angle = (turns * scene.robot.motor_matrix[1] if turns else np.eye(3)[1]) @ scene.q
    for k, wave in enumerate((np.sin(angle), np.cos(angle))):
        misread = np.outer([0.0, 1.0, 0.0], wave)
        column = effect.columns(scene, Place(1), {"turns": turns})[:, k]
        expected = -scene.along(misread)  # time derivatives by the spectrum here, exact there
        assert np.abs(column - expected).max() < 1e-3 * np.abs(expected).max()


def test_a_late_encoder_turns_the_friction_between_true_and_read_reversal():
    scene, late = scene_of(null()), 5e-3
    column = effect_named("encoder_time_skew").columns(scene, Place(), {"late": late})[:, 1]
    ahead = np.sign(delayed(scene, scene.speed, -late)) != scene.direction
    assert ahead.any()
    assert ((column[:3] != 0.0) == ahead).all()
    assert not column[3:].any()


def test_a_stated_spring_is_not_named_again():
    places = effect_named("gravity_compensation_spring").places(scene_of(null()))
    assert [place.joint for place in places] == [0, 2]  # joint 2's is in the robot file


def test_the_tool_points_on_along_the_last_segment():
    for name in ("ir361", "six_axis"):
        plant = load_plant(name)
        axes = distal_axes(build_robot(robot_toml(plant, "arm.urdf"), plant.urdf_text, name).robot)
        assert np.allclose(axes.T @ axes, np.eye(3))
        assert np.allclose(axes[:, 0], [0.0, 0.0, 1.0])


def test_responses_are_those_of_their_equations():
    scene = scene_of(null())
    t, x = scene.t_s, scene.q[0]
    late = delayed(scene, x, 0.013)
    assert np.abs(np.interp(t[200:] - 0.013, t, x) - late[200:]).max() < 1e-4
    slow = lagging(scene, x, 0.7)
    assert np.allclose(x - slow, 0.7 * scene.ddt(slow), atol=1e-9)
    swing, natural = resonant(scene, x, 3.0, 0.1), 2.0 * np.pi * 3.0
    rate = scene.ddt(swing)
    pull = scene.ddt(rate) + 2.0 * 0.1 * natural * rate + natural**2 * swing
    assert np.allclose(pull, natural**2 * x, atol=1e-6)
