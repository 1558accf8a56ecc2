"""Counts of identifiable parameters, and that the definitions reproduce the rows."""

from dataclasses import replace

import numpy as np
import pytest

from identify.errors import ModelError
from identify.model import build_model
from identify.robot import ForcePlate
from identify.structure import find_structure
from tests.identify import chains
from tests.identify.robots import drives_changed, ir361, raw_truth, true_theta


def test_counts_of_the_reference_robot():
    assert find_structure(ir361()).counts == {"internal": 28, "external": 19, "combined": 34}


def test_an_untared_plate_sees_the_mass_too():
    counts = find_structure(replace(ir361(), plate=ForcePlate(tared=False))).counts
    assert counts == {"internal": 28, "external": 20, "combined": 35}


def test_without_a_plate_only_the_internal_model_exists():
    robot = replace(ir361(), plate=None)
    assert find_structure(robot).counts == {"internal": 28}
    with pytest.raises(ModelError, match="needs a force plate"):
        build_model(robot, "combined")


def test_rotors_unknown_are_parameters_of_their_own_only_with_the_plate():
    robot = drives_changed(ir361(), rotor_inertia=None)
    structure = find_structure(robot)
    combined = build_model(robot, "combined", structure)
    internal = build_model(robot, "internal", structure)
    assert [p.name for p in combined.parameters if p.group == "rotor"] != []
    assert structure.counts["combined"] > 34
    assert structure.counts["internal"] <= 28 + 3
    assert len(internal.parameters) == structure.counts["internal"]


@pytest.mark.parametrize("kind", ["combined", "internal", "external"])
@pytest.mark.parametrize("known_rotors", [True, False])
def test_definitions_reproduce_the_rows_of_the_reference_robot(kind, known_rotors):
    robot = ir361() if known_rotors else drives_changed(ir361(), rotor_inertia=None)
    model, truth = build_model(robot, kind), raw_truth(robot)
    _compare_with_raw(model, truth, chains.random_states(8, 3, 60))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["combined", "internal", "external"])
def test_definitions_reproduce_the_rows_of_random_chains(seed, kind):
    n = 3 + seed % 3
    robot = chains.robot_of(
        chains.random_description(seed, n), chains.random_plate(seed, tared=bool(seed % 2))
    )
    _compare_with_raw(build_model(robot, kind), raw_truth(robot), chains.random_states(seed, n, 60))


def _compare_with_raw(model, truth, states):
    """Base parameters through their rows give what the raw link parameters give through theirs."""
    from identify.friction import internal_columns
    from identify.inertia import PARAMETERS
    from identify.parameters import internal_parameters
    from identify.regressor import rigid_columns

    robot, theta = model.robot, true_theta(model, truth)
    raw = rigid_columns(robot, *states)
    pi = np.array([truth[f"{link}.{p}"] for link in robot.link_names for p in PARAMETERS])
    rotors = np.array(
        [
            (truth[f"{j.name}.rotor_inertia"] if j.drive.rotor_inertia is None else j.drive.rotor_inertia)
            if j.drive.has_rotor
            else 0.0
            for j in robot.joints
        ]
    )
    if model.kind != "external":
        rows = model.drive_rows(*states)
        inner = np.array([truth[p.name] for p in internal_parameters(robot)])
        expected = np.einsum("cpn,p->cn", raw.internal, pi) + np.einsum(
            "cpn,p->cn", raw.rotor_internal, rotors
        )
        if len(inner):
            expected += np.einsum("cpn,p->cn", internal_columns(robot, *states[:2]), inner)
        _close(np.einsum("cpn,p->cn", rows.columns, theta) + rows.known, expected)
    if model.kind != "internal":
        rows = model.wrench_rows(*states)
        expected = np.einsum("cpn,p->cn", raw.external, pi) + np.einsum(
            "cpn,p->cn", raw.rotor_external, rotors
        )
        if robot.plate.tared:
            expected = (
                expected + np.array([truth[p.name] for p in model.parameters if p.group == "plate"])[:, None]
            )
        _close(np.einsum("cpn,p->cn", rows.columns, theta) + rows.known, expected)


def _close(found, expected):
    """Equal up to rounding."""
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())


def test_the_three_models_share_their_functionals():
    """d_i is a subset of d_e: what has the same name means the same in all three."""
    robot = ir361()
    structure = find_structure(robot)
    models = {kind: build_model(robot, kind, structure) for kind in ("combined", "internal", "external")}
    definitions = {
        kind: {p.name: p.definition for p in m.parameters if p.group == "inertial"}
        for kind, m in models.items()
    }
    assert set(definitions["internal"]) < set(definitions["combined"])
    for kind in ("internal", "external"):
        shared = set(definitions[kind]) & set(definitions["combined"])
        assert len(shared) == len(definitions[kind])
        for name in shared:
            assert definitions[kind][name] == pytest.approx(definitions["combined"][name])


def test_columns_are_independent_and_every_row_space_direction_is_covered():
    from identify.regressor import rigid_columns

    robot = chains.robot_of(chains.random_description(2, 5), chains.random_plate(2))
    model = build_model(robot, "combined")
    states = chains.random_states(77, 5, 200)
    rows = np.concatenate([model.drive_rows(*states).columns, model.wrench_rows(*states).columns])
    flat = rows.transpose(0, 2, 1).reshape(-1, rows.shape[1])
    values = np.linalg.svd(flat / np.linalg.norm(flat, axis=0), compute_uv=False)
    assert values[-1] > 1e-5 * values[0]
    raw = rigid_columns(robot, *states)
    whole = np.concatenate([raw.internal, raw.external]).transpose(0, 2, 1).reshape(-1, 50)
    norms = np.linalg.norm(whole, axis=0)
    whole = whole[:, norms > 1e-9 * norms.max()] / norms[norms > 1e-9 * norms.max()]
    assert np.linalg.matrix_rank(whole, tol=1e-8) == len(model.parameters)


def test_unknown_kinds_are_refused():
    with pytest.raises(ModelError, match="choose combined, internal or external"):
        build_model(ir361(), "both")
