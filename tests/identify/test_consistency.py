"""Physical consistency: bodies with a known answer, the projection's optimality, the freedom that is left."""

from dataclasses import replace

import numpy as np
import pytest

from identify.consistency import check_consistency
from identify.inertia import pseudo_inertia
from identify.model import build_model
from identify.parameters import unknown_rotors
from tests.identify.robots import drives_changed, ir361, raw_truth, true_theta

CONSTANTS = np.array([0.215, 0.215, 0.155])


@pytest.fixture(scope="module")
def model():
    return build_model(replace(ir361(), reference_parameters=None), "combined")


@pytest.fixture(scope="module")
def truth(model):
    return true_theta(model, raw_truth(ir361()))


def covariance(model, correlated=True):
    """A made-up covariance: 1 % of each parameter's size, correlated."""
    count = len(model.parameters) + model.robot.n
    rng = np.random.default_rng(7)
    root = np.eye(count) + (0.3 * rng.normal(size=(count, count)) / np.sqrt(count) if correlated else 0.0)
    std = 0.05 * np.ones(count)
    std[-model.robot.n :] = 1e-3
    return std[:, None] * (root @ root.T) * std


def base_of(model, found):
    return model.basis.definitions @ np.concatenate([found.links.ravel(), found.rotors])


def smallest(found):
    return min(np.linalg.eigvalsh(pseudo_inertia(link))[0] for link in found.links)


@pytest.mark.parametrize("kind", ["combined", "internal", "external"])
def test_a_real_arm_is_consistent(kind):
    model = build_model(replace(ir361(), reference_parameters=None), kind)
    theta = true_theta(model, raw_truth(ir361()))
    found = check_consistency(model, theta, covariance(model), CONSTANTS)
    assert found.consistent and found.within_uncertainty
    assert found.distance == 0.0
    assert found.violations == ()
    np.testing.assert_allclose(base_of(model, found), theta[: len(model.basis.names)], rtol=1e-9, atol=1e-9)
    assert smallest(found) > 0.0
    assert "consistent:" in found.sentence and "inconsistent" not in found.sentence


def test_the_reference_inertials_fill_what_the_estimate_leaves_open(model, truth):
    with_reference = build_model(ir361(), "combined")
    found = check_consistency(with_reference, truth, covariance(model), CONSTANTS)
    np.testing.assert_allclose(found.links, ir361().reference_parameters, rtol=1e-6, atol=1e-7)
    assert "URDF" in found.prior
    assert found.filled == 30 - len(model.basis.names)


def test_a_parameter_fixed_alone_is_found_out_with_its_exact_distance(model, truth):
    """link_3.Iyy is a base parameter by itself and positive: the distance to zero is value over std."""
    noise = covariance(model, correlated=False)
    theta = truth.copy()
    for name in ("link_3.mx", "link_3.mz", "link_3.Ixy", "link_3.Iyz", "link_3.Ixz", "link_3.Izz+..."):
        theta[model.index(name)] = 0.0
    theta[model.index("link_3.Iyy")] = -0.40  # eight std below zero
    found = check_consistency(model, theta, noise, CONSTANTS)
    assert not found.consistent and not found.within_uncertainty
    assert found.distance == pytest.approx(8.0, rel=1e-3)
    assert "link_3.Iyy" in found.sentence and "8 std" in found.sentence
    assert found.projected[model.index("link_3.Iyy")] == pytest.approx(0.0, abs=1e-3)
    assert smallest(found) > 0.0


def test_within_uncertainty(model, truth):
    noise = covariance(model, correlated=False)
    theta = truth.copy()
    for name in ("link_3.mx", "link_3.mz", "link_3.Ixy", "link_3.Iyz", "link_3.Ixz", "link_3.Izz+..."):
        theta[model.index(name)] = 0.0
    theta[model.index("link_3.Iyy")] = -0.05
    found = check_consistency(model, theta, noise, CONSTANTS)
    assert not found.consistent and found.within_uncertainty
    assert found.distance == pytest.approx(1.0, rel=0.05)
    assert "within its uncertainty" in found.sentence


def test_the_projection_is_the_nearest_point(model, truth):
    """No step towards another possible set of bodies comes nearer (the problem is convex)."""
    theta = truth.copy()
    theta[model.index("link_3.Iyy")] = -0.3
    theta[model.index("joint_1.coulomb")] = -0.2
    noise = covariance(model)
    found = check_consistency(model, theta, noise, CONSTANTS)
    whole = np.concatenate([theta, CONSTANTS])
    inverse = np.linalg.inv(noise)
    projected = np.concatenate([found.projected, found.projected_constants])
    squared = float((projected - whole) @ inverse @ (projected - whole))
    assert squared == pytest.approx(found.distance**2, rel=1e-6)
    rng = np.random.default_rng(1)
    for _ in range(50):
        raw = raw_truth(ir361())
        for link in ir361().link_names:  # a random possible body
            body = random_body(rng)
            raw |= {f"{link}.{name}": value for name, value in body.items()}
        raw |= {f"joint_{k}.coulomb": abs(rng.normal()) for k in (1, 2, 3)}
        other = np.concatenate([true_theta(model, raw), CONSTANTS])
        slope = float((projected - whole) @ inverse @ (other - projected))
        assert slope > -1e-3 * found.distance * np.sqrt((other - projected) @ inverse @ (other - projected))


def random_body(rng):
    from identify.inertia import PARAMETERS

    points = rng.normal(size=(4, 6)) * rng.uniform(0.05, 1.0)
    masses = rng.uniform(0.1, 20.0, 6)
    points[3] = 1.0
    matrix = (points * masses) @ points.T
    second = matrix[:3, :3]
    inertia = np.trace(second) * np.eye(3) - second
    values = [matrix[3, 3], *matrix[:3, 3], *inertia[np.triu_indices(3)]]
    return dict(zip(PARAMETERS, values, strict=True))


def test_signs_of_friction_and_constants(model, truth):
    theta = truth.copy()
    theta[model.index("joint_3.viscous")] = -0.1
    found = check_consistency(model, theta, covariance(model, correlated=False), np.array([0.2, -0.002, 0.1]))
    assert not found.consistent
    assert found.violations == (
        "joint_2's torque constant must have the sign of its nominal value",
        "joint_3.viscous must not be negative",
    )
    assert found.distance == pytest.approx(np.hypot(2.0, 2.0 + 0.215), rel=1e-2)
    assert found.projected[model.index("joint_3.viscous")] == pytest.approx(0.0, abs=1e-6)


def test_asymmetric_friction_dissipates_both_ways():
    robot = drives_changed(ir361(), friction=("coulomb", "viscous", "asymmetric_viscous"))
    model = build_model(robot, "internal")
    raw = raw_truth(robot) | {f"joint_{k}.asymmetric_viscous": 1.0 for k in (1, 2, 3)}
    raw["joint_2.asymmetric_viscous"] = raw["joint_2.viscous"] + 0.1
    found = check_consistency(model, true_theta(model, raw), covariance(model))
    assert found.violations == ("joint_2's viscous friction must not be negative backward",)


def test_what_is_not_identifiable_constrains_nothing(model, truth):
    theta, noise = truth.copy(), covariance(model)
    theta[model.index("link_3.Iyy")] = -5.0
    assert not check_consistency(model, theta, noise, CONSTANTS).consistent
    index = model.index("link_3.Iyy")
    theta[index] = np.nan
    noise[index, :] = noise[:, index] = np.nan
    found = check_consistency(model, theta, noise, CONSTANTS)
    assert found.consistent
    assert np.isnan(found.projected[index])


def test_unknown_rotor_inertia_is_positive():
    robot = drives_changed(replace(ir361(), reference_parameters=None), rotor_inertia=None)
    model = build_model(robot, "combined")
    theta = true_theta(model, raw_truth(ir361()))
    assert len(unknown_rotors(robot)) == 3
    found = check_consistency(model, theta, covariance(model), CONSTANTS)
    assert found.consistent and (found.rotors > 0.0).all()
    names = [p.name for p in model.parameters if p.group == "rotor"]
    alone = [p.name for p in model.parameters if p.group == "rotor" and len(p.definition) == 1]
    assert names, "the plate tells rotors from links"
    theta[model.index(alone[0])] = -0.5
    noise = covariance(model, correlated=False)
    found = check_consistency(model, theta, noise, CONSTANTS)
    assert not found.consistent
    assert found.distance == pytest.approx(10.0, rel=0.02)
