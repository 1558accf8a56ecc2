"""Files that go with an excitation: twin, slow copy, validation, static poses, sweeps; each checked."""

from __future__ import annotations

from typing import Any

import numpy as np

from identify.excitation.companions import (
    Moves,
    constant_speed_sweeps,
    joined,
    random_points,
    reversed_twin,
    slow_copy,
)
from identify.excitation.design import Design
from identify.excitation.moves_check import move_allowed
from identify.model import build_model
from service.designs import excitation_content, moves_content
from service.robots import LoadedRobot

_POSES, _POSE_PAUSE_S, _VALIDATION_POINTS = 30, 2.0, 20


def companion_content(result: Design, loaded: LoadedRobot, kind: str) -> dict[str, Any]:
    """Give the content of a companion file.

    Args:
        result: the design.
        loaded: its robot.
        kind: ``twin``, ``slow``, ``validation``, ``poses`` or ``sweeps``.

    Returns:
        A JSON object with its hash.

    Raises:
        identify.excitation.errors.DesignError: the workspace leaves no such motion.
    """
    if kind == "twin":
        return excitation_content(result, reversed_twin(result.series))
    if kind == "slow":
        return excitation_content(result, slow_copy(result.series))
    if kind == "sweeps":
        return moves_content(result, all_sweeps(result), "sweeps")
    count, pause_s = (_VALIDATION_POINTS, 0.5) if kind == "validation" else (_POSES, _POSE_PAUSE_S)
    model = build_model(loaded.robot, result.model)
    moves = random_points(
        result.limits,
        result.options.seed + (kind == "poses"),
        count,
        pause_s,
        lambda move: move_allowed(model, result.reference, result.limits, result.options.workspace, move),
    )
    return moves_content(result, moves, kind)


def all_sweeps(result: Design) -> Moves:
    """Sweep every joint in turn."""
    home = np.clip(0.0, result.limits.lower, result.limits.upper)
    parts = [constant_speed_sweeps(result.limits, joint, pose=home) for joint in range(len(result.joints))]
    return joined(parts, result.limits)
