"""Whether a move from rest to rest keeps torques and distances."""

from __future__ import annotations

import numpy as np

from identify.excitation.companions import Moves
from identify.excitation.limits import MotionLimits
from identify.excitation.reference import ReferenceModel, drive_torque
from identify.excitation.verify import least_distance_m
from identify.excitation.workspace import Workspace
from identify.model import Model

_STEP_S = 0.01


def move_allowed(
    model: Model, reference: ReferenceModel, limits: MotionLimits, workspace: Workspace, moves: Moves
) -> bool:
    """Check moves every 10 ms; a distance must exceed its margin by what the arm could travel in between.

    Args:
        model: the model of the reference.
        reference: expected parameter values.
        limits: of the joints.
        workspace: obstacles.
        moves: what is to be checked.

    Returns:
        Whether torques and distances keep their limits.
    """
    q, qd, qdd = moves.evaluate(np.arange(0.0, moves.total_s + _STEP_S, _STEP_S))
    if np.isfinite(limits.effort).any():
        torque = np.abs(drive_torque(model, reference.theta, q, qd, qdd)).max(axis=1)
        if (torque > limits.effort).any():
            return False
    if workspace.empty:
        return True
    reach = sum(float(np.linalg.norm(joint.translation_m)) for joint in model.robot.joints)
    reach += max(float(np.linalg.norm(sphere.center_m)) for sphere in workspace.spheres)
    travel = float(np.abs(qd).sum(axis=0).max()) * reach * _STEP_S
    return least_distance_m(model.robot, workspace, q) >= workspace.margin_m + 0.5 * travel
