"""Drive and wrench rows of a combined model in one pass over the chain: the search needs both every time."""

from __future__ import annotations

import numpy as np

from identify.friction import internal_columns
from identify.model import Model
from identify.parameters import internal_parameters, plate_parameters, unknown_rotors
from identify.regressor import rigid_columns
from identify.rotations import FloatArray
from identify.structure import remove_replaced_gravity, to_drives


def stacked_rows(
    model: Model, q: FloatArray, qd: FloatArray, qdd: FloatArray, sign: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Evaluate the model's rows, equal to ``drive_rows`` above ``wrench_rows`` at half the cost.

    Args:
        model: combined or internal.
        q: joint positions, shape (n, N).
        qd: joint velocities, shape (n, N).
        qdd: joint accelerations, shape (n, N).
        sign: direction of Coulomb friction; None takes that of the drive speeds.

    Returns:
        Columns, shape (channels, P, N), and what needs no parameter (known rotors), shape (channels, N).
    """
    robot, basis = model.robot, model.basis
    both = model.kind == "combined"
    rigid = rigid_columns(robot, q, qd, qdd, external=both)
    rotor = to_drives(robot, rigid.rotor_internal)
    drives = np.concatenate([to_drives(robot, rigid.internal), rotor[:, unknown_rotors(robot)]], axis=1)
    nuisance = internal_columns(robot, q, qd, sign)
    names = [parameter.name for parameter in internal_parameters(robot)]
    remove_replaced_gravity(robot, model.structure.replaced, drives, nuisance, names)
    raw = drives
    if both:
        wrench = np.concatenate([rigid.external, rigid.rotor_external[:, unknown_rotors(robot)]], axis=1)
        raw, rotor = np.concatenate([drives, wrench]), np.concatenate([rotor, rigid.rotor_external])
    columns = np.zeros((len(raw), len(model.parameters), q.shape[1]))
    count = len(basis.columns)
    columns[:, :count] = _mixed(raw[:, basis.columns], basis.mixing)
    columns[: robot.n, count : count + nuisance.shape[1]] = nuisance
    offsets = len(plate_parameters(robot))
    if both and offsets:
        columns[robot.n :, -offsets:] = np.eye(6)[:, :, None]
    known = [
        (k, j.drive.rotor_inertia)
        for k, j in enumerate(robot.joints)
        if j.drive.has_rotor and j.drive.rotor_inertia
    ]
    return columns, sum((rotor[:, k] * inertia for k, inertia in known), np.zeros((len(raw), q.shape[1])))


def _mixed(picked: FloatArray, mixing: FloatArray) -> FloatArray:
    return picked if np.array_equal(mixing, np.eye(len(mixing))) else np.matmul(mixing.T, picked)
