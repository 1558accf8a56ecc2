from dataclasses import replace

import numpy as np
import pytest

from identify.excitation.criteria import ConditionNumber, DOptimal
from identify.excitation.discriminate import Discriminating
from identify.excitation.information import NamedEffect, information_model
from identify.excitation.stacked_rows import stacked_rows
from identify.excitation.workspace import Box, Sphere, Workspace


def numeric_gradient(problem, x, step=1e-5):
    ways = step * np.eye(len(x))
    return np.array(
        [
            (
                problem.value_and_gradient(x + way, 25.0, 1e3)[0]
                - problem.value_and_gradient(x - way, 25.0, 1e3)[0]
            )
            / (2 * step)
            for way in ways
        ]
    )


WORKSPACE = Workspace(
    (Sphere(1, np.array([0.0, 0.0, 0.5]), 0.05, "tip"), Sphere(-1, np.array([0.4, 0.0, 0.9]), 0.1, "post")),
    floor_m=0.9,
    boxes=(Box(np.array([-0.5, -0.5, 1.15]), np.array([-0.3, 0.5, 1.3])),),
    pairs=((0, 1),),
)


@pytest.mark.parametrize("criterion", [DOptimal(), ConditionNumber()], ids=["d", "condition"])
@pytest.mark.parametrize("workspace", [Workspace(), WORKSPACE], ids=["free", "obstacles"])
def test_gradient_of_the_objective(problem, criterion, workspace):
    limits = replace(problem.mapping.limits, effort=np.array([20.0, 50.0]))
    mapping = replace(problem.mapping, limits=limits)
    problem = replace(problem, criterion=criterion, workspace=workspace, mapping=mapping)
    x = problem.mapping.random(np.random.default_rng(4))
    found = problem.value_and_gradient(x, 25.0, 1e3)[1]
    wanted = numeric_gradient(problem, x)
    np.testing.assert_allclose(found, wanted, rtol=2e-3, atol=2e-3 * np.abs(wanted).max())


def delayed(q, qd, qdd):
    """A column that looks along time: what was two samples ago, on the second joint."""
    columns = np.zeros((8, 1, q.shape[1]))
    columns[1, 0] = np.roll(np.cos(3.0 * q[0]) * qd[1] ** 3, 2)
    return columns


def test_gradient_through_effects_that_look_along_time(problem):
    information = problem.information
    information = information_model(
        information.model, information.noise, information.reference, problem.mapping.limits,
        (NamedEffect("late", delayed),),
    )  # fmt: skip
    criterion = Discriminating(information.baseline, information.effect_columns)
    problem = replace(problem, information=information, criterion=criterion)
    x = problem.mapping.random(np.random.default_rng(4))
    found = problem.value_and_gradient(x, 25.0, 1.0)[1]
    wanted = numeric_gradient(problem, x)
    np.testing.assert_allclose(found, wanted, rtol=5e-3, atol=5e-3 * np.abs(wanted).max())


def test_stacked_rows_are_the_models_own(problem):
    model = problem.information.model
    rng = np.random.default_rng(0)
    q, qd, qdd = rng.normal(size=(3, 2, 20))
    columns, known = stacked_rows(model, q, qd, qdd, None)
    drives, wrench = model.drive_rows(q, qd, qdd), model.wrench_rows(q, qd, qdd)
    np.testing.assert_array_equal(columns, np.concatenate([drives.columns, wrench.columns]))
    np.testing.assert_array_equal(known, np.concatenate([drives.known, wrench.known]))


def test_expected_covariance_is_that_of_simulated_fits(problem):
    """Fits of simulated runs scatter as the information matrix says, torque constants included."""
    information = problem.information
    motion = problem.mapping.series(problem.mapping.random(np.random.default_rng(6)))
    sample = information.sample(*motion.evaluate(motion.grid_s(200)))
    matrix = sample.information(200)
    rows = sample.columns.transpose(0, 2, 1).reshape(-1, sample.columns.shape[1])
    rng = np.random.default_rng(7)
    fits = np.linalg.lstsq(rows, rng.normal(size=(len(rows), 3000)), rcond=None)[0]
    wanted = np.sqrt(np.diag(np.linalg.inv(matrix)))
    np.testing.assert_allclose(fits.std(axis=1), wanted, rtol=0.06)
    assert [name for name in information.names if name.endswith("torque_constant")] == [
        "yaw.torque_constant",
        "pitch.torque_constant",
    ]
