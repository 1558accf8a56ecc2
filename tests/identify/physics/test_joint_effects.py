"""Effects inside the joints, their motors and currents, against a robot whose physics is its own."""

import string

import numpy as np
import pytest

from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.rigid import RigidPlant
from drivers.virtual.spring import spring_torque
from identify.diagnosis.between import progressive_tests
from identify.diagnosis.problem import build_problem
from identify.physics.bearing_moment_friction import _tilting_moment
from identify.physics.catalogue import effect_named
from identify.physics.effect import Place
from tests.identify.physics.joint_recordings import PLANT, DirectedTest, estimate, null, recorded, scene_of

_A, _PH = 0.03, 0.7
_SWING = 1.2e-5

# effect, joint, what the virtual robot gets, shape, coefficients that must come out
STEADY = [
    ("asymmetric_viscous_friction", 0, {"difference_nm_s": 3.0}, {}, [3.0]),
    ("nonlinear_viscous_friction", 0, {"coefficient": 9.0, "power": 2.5}, {"p": 2.5}, [9.0]),
    ("load_dependent_friction", 2, {"coefficient": 0.15}, {}, [0.15]),
    ("bearing_moment_friction", 0, {"coefficient": 0.05}, {}, [0.05]),
    (
        "position_dependent_friction", 1, {"amplitude_nm": 4.0, "order": 4, "phase_rad": _PH}, {"m": 4.0},
        [4.0 * np.cos(_PH), 4.0 * np.sin(_PH)],
    ),
    ("presliding_friction", 2, {"slide_rad": 2e-3}, {"xs": 2e-3}, [PLANT.joints[2].coulomb_nm]),
    (
        "coupled_transmission_friction", 0,
        {"coulomb_nm": 8.0, "viscous_nm_s": 3.0, "ratio": 0.4}, {"c": 0.4}, [8.0, 3.0],
    ),
    (
        "cogging", 0, {"amplitude_nm": 3.0, "order": 3, "phase_rad": _PH}, {"k": 3.0},
        [3.0 * np.cos(_PH), -3.0 * np.sin(_PH)],
    ),
    (
        "torque_ripple", 1, {"share": _A, "order": 2, "phase_rad": _PH}, {"k": 2.0},
        [_A * np.cos(_PH), -_A * np.sin(_PH)],
    ),
    (
        "transmission_error", 1, {"amplitude_rad": _SWING, "order": 2, "phase_rad": _PH}, {"k": 2.0},
        [_SWING * np.sin(_PH), _SWING * np.cos(_PH)],
    ),
    ("backlash", 0, {"gap_rad": 8e-4, "crossing_hz": 12.0}, {"f": 12.0}, [8e-4]),
    ("joint_elasticity", 0, {"compliance_rad_nm": 2e-4}, {}, [2e-4]),
    ("rotor_inertia", 1, {"share": 0.3}, {}, [0.3 * PLANT.joints[1].rotor_inertia_kg_m2]),
    ("torque_constant_saturation", 1, {"coefficient_1_a2": 0.0025}, {}, [0.0025]),
    ("current_dead_zone", 1, {"width_a": 0.09}, {}, [0.09]),
    ("current_delay", 1, {"delay_s": 3e-3}, {"lag": 3e-3}, [3e-3]),
]
PROGRESSIVE = ["thermal_friction", "torque_constant_drift", "current_offset_drift"]
ALL = [case[0] for case in STEADY] + PROGRESSIVE + ["torque_constant_error"]


def _place(name, joint):
    return Place(joint=joint, partner=joint + 1 if name == "coupled_transmission_friction" else None)


def _middle(effect):
    return {shape.name: shape.grid[len(shape.grid) // 2] for shape in effect.shapes}


@pytest.mark.parametrize(("name", "joint", "true", "shape", "expected"), STEADY, ids=ALL[: len(STEADY)])
def test_recovers_an_effect_of_the_virtual_robot(name, joint, true, shape, expected):
    effect, place = effect_named(name), _place(name, joint)
    fitted = recorded(EffectSpec(name, f"joint_{joint + 1}", None, true))
    got = estimate(fitted, effect, place, shape)
    assert (np.abs(got.values - expected) < 3.5 * got.std).all(), (got.values, expected, got.std)
    if got.gain > 2000.0:  # then a tenth is far beyond noise
        assert np.linalg.norm(got.values - expected) < 0.1 * np.linalg.norm(expected)
    assert got.gain > 9.0
    assert place in effect.places(scene_of(fitted))
    assert effect.allowed(scene_of(fitted), place, got.values, shape)


def test_absent_effects_are_within_their_noise():
    scene, worst, test = scene_of(null()), [], DirectedTest(null())
    for name in (case[0] for case in STEADY):
        effect = effect_named(name)
        for place in effect.places(scene):
            worst.append(np.max(np.abs(test.ratio(effect, place, _middle(effect)))))
    assert 0.5 < np.median(worst) < 2.0  # neither biased nor with inflated errors
    assert max(worst) < 4.5


@pytest.mark.parametrize("name", ALL)
def test_columns_stand_only_where_the_effect_acts(name):
    scene, effect = scene_of(null()), effect_named(name)
    places = effect.places(scene) or [Place(joint=1)]
    for place in places:
        columns = effect.columns(scene, place, _middle(effect))
        assert columns.shape == (scene.rows, len(effect.coefficients), len(scene.t_s))
        energy = np.sum(columns**2, axis=(1, 2))
        assert energy[place.joint] > 0.0 or name == "rotor_inertia"
        assert (energy[scene.robot.n :].sum() > 0.0) == (effect.where in "BPS")
        if effect.where == "I":
            others = [k for k in range(scene.robot.n) if k not in (place.joint, place.partner)]
            assert not energy[others].any()


@pytest.mark.parametrize("name", ALL)
def test_sentences_name_their_place_and_numbers(name):
    effect = effect_named(name)
    known = {"place"} | {c.name for c in effect.coefficients} | {s.name for s in effect.shapes}
    used = {field for _, field, _, _ in string.Formatter().parse(effect.sentence) if field}
    assert used <= known
    assert {"place", effect.coefficients[0].name} <= used
    assert effect.reference


def test_torque_constants_are_tested_only_where_taken_as_exact():
    effect = effect_named("torque_constant_error")
    assert effect.places(scene_of(null())) == []
    weak = EffectSpec("torque_constant_error", "joint_3", None, {"share": -0.1})
    fitted = recorded(weak, nominal=True)
    assert len(effect.places(scene_of(fitted))) == 3
    got = estimate(fitted, effect, Place(joint=2), {})
    assert abs(got.values[0] - (1.0 / 0.9 - 1.0)) < 3.5 * got.std[0]
    assert got.gain > 500.0


CHANGES = [
    (
        "thermal_friction", "joint_1", {"share": 0.4, "time_constant_s": 18.0, "coulomb_share": 0.0},
        "settling",
    ),
    ("torque_constant_drift", "joint_2", {"share": 0.08, "time_constant_s": 18.0}, "settling"),
    ("current_offset_drift", "joint_3", {"slope_a_s": 0.01}, "ramp"),
]


@pytest.mark.parametrize(("name", "joint", "true", "course"), CHANGES, ids=[case[0] for case in CHANGES])
def test_recovers_what_changes_during_the_run(name, joint, true, course):
    problem = build_problem(recorded(EffectSpec(name, joint, None, true), periods=6))
    tests = [t for t in progressive_tests(problem, [effect_named(name)]) if t.course == course]
    best = max(tests, key=lambda item: item.gain)
    index = int(joint[-1]) - 1
    drive, begun = PLANT.joints[index], np.exp(-10.0 / 18.0)  # one transient period has passed
    expected = {
        "thermal_friction": 0.4 * begun * drive.viscous_nm_s,
        "torque_constant_drift": -0.08 * begun,
        "current_offset_drift": 0.01 * drive.gear_ratio * drive.torque_constant_nm_a,
    }[name]
    assert best.place.joint == index
    assert best.p_value < 1e-6
    assert abs(best.values[0] - expected) < 3.5 * best.std[0] + 0.1 * abs(expected)


@pytest.mark.parametrize(
    ("name", "values", "shape"),
    [
        ("asymmetric_viscous_friction", [1e3], {}),
        ("nonlinear_viscous_friction", [-1e3], {"p": 3.0}),
        ("load_dependent_friction", [1.0], {}),
        ("load_dependent_friction", [-0.1], {}),
        ("bearing_moment_friction", [-0.1], {}),
        ("position_dependent_friction", [500.0, 0.0], {"m": 4.0}),
        ("presliding_friction", [500.0], {"xs": 1e-3}),
        ("coupled_transmission_friction", [1.0, -1.0], {"c": 0.5}),
        ("torque_ripple", [1.0, 1.0], {"k": 2.0}),
        ("backlash", [-1e-4], {"f": 12.0}),
        ("joint_elasticity", [-1e-5], {}),
        ("rotor_inertia", [-1.0], {}),
        ("torque_constant_error", [-1.0], {}),
        ("torque_constant_saturation", [1.0], {}),
        ("torque_constant_drift", [-0.1], {}),
        ("current_dead_zone", [-0.1], {}),
        ("current_delay", [1e-2], {"lag": 1e-3}),
    ],
)
def test_refuses_values_that_are_not_physical(name, values, shape):
    effect, scene = effect_named(name), scene_of(null())
    assert not effect.allowed(scene, _place(name, 0), np.array(values), shape)


def test_loads_and_tilting_moment_are_those_of_the_bodies():
    scene = scene_of(null())
    true = RigidPlant(PLANT).inverse(scene.q.T, scene.qd.T, scene.qdd.T, tilting=True)
    tilting = true.tilting_nm[:, 0]
    assert np.abs(_tilting_moment(scene) - tilting).max() < 0.01 * tilting.max()
    load = true.link_nm.T
    assert (np.abs(scene.load - load).max(axis=1) < 0.05 * np.abs(load).max(axis=1)).all()


def test_presliding_steps_through_reversals_as_a_finely_stepped_state_does():
    scene, effect = scene_of(null()), effect_named("presliding_friction")
    column = effect.columns(scene, Place(joint=0), {"xs": 1e-3})[0, 0]
    fine = np.linspace(0.0, 1.0, 51)[1:]  # along the cubic through angle and speed of both neighbours
    q, v = scene.q[0], scene.qd[0] * scene.step_s
    q0, v0 = np.roll(q, 1)[:, None], np.roll(v, 1)[:, None]
    rise, v1 = q[:, None] - q0, v[:, None]
    path = q0 + v0 * fine + (3 * rise - 2 * v0 - v1) * fine**2 + (v0 + v1 - 2 * rise) * fine**3
    moves = np.diff(np.concatenate([q0, path], axis=1), axis=1)
    state, result = 0.0, np.zeros(len(q))
    for _ in range(2):
        for k, steps in enumerate(moves):
            for move in steps:
                state = np.sign(move) + (state - np.sign(move)) * np.exp(-abs(move) / 1e-3)
            result[k] = state
    assert np.abs(column - (result - scene.direction[0])).max() < 5e-3


def test_models_of_the_plate_alone_have_no_effects_inside_joints():
    scene = scene_of(recorded(kind="external"))
    for name in ALL:
        places = effect_named(name).places(scene)
        assert places == [] or name == "rotor_inertia"


def test_load_of_a_sprung_joint_without_plate_is_that_of_gear_and_spring():
    scene = scene_of(recorded(kind="internal"))
    load = RigidPlant(PLANT).inverse(scene.q.T, scene.qd.T, scene.qdd.T).link_nm[:, 1]
    load = load + spring_torque(PLANT.joints[1].spring, scene.q[1])
    assert np.abs(scene.load[1] - load).max() < 0.1 * np.abs(load).max()
