"""An estimate or a diagnosis as a model that can be run: parameters with the effects found beside them."""

from __future__ import annotations

from typing import Any

import numpy as np

from identify.physics.catalogue import effect_named
from identify.physics.effect import Place
from identify.robot import Robot
from identify.simulation import AppliedEffect, Course, FullModel
from service.errors import UsageError
from service.estimate_reading import Estimate


def full_model(estimate: Estimate) -> FullModel:
    """Make a model that can be run of an estimate.

    Args:
        estimate: the estimate, augmented or plain.

    Returns:
        The model; what is not identifiable is taken as zero, torque constants without a value as nominal.

    Raises:
        UsageError: an effect in it is not understood.
    """
    nominal = np.array([j.drive.torque_constant or 1.0 for j in estimate.loaded.robot.joints])
    constants = estimate.torque_constants
    known = np.isfinite(constants) & (constants != 0.0)
    scale = np.where(known, nominal / np.where(known, constants, 1.0), 1.0)
    effects = tuple(_effect(entry, estimate) for entry in estimate.content.get("effects", []))
    return FullModel(estimate.model, np.nan_to_num(estimate.theta), scale, effects)


def _effect(entry: Any, estimate: Estimate) -> AppliedEffect:
    try:
        effect = effect_named(entry["effect"])
        robot = estimate.loaded.robot
        place = Place(_index(entry["joint"], robot), entry["channel"], _index(entry.get("partner"), robot))
        shape = {s.name: float(entry["shape"][s.name]) for s in effect.shapes}
        course = None if entry.get("course") is None else _course(entry["course"])
        found, dying = entry["coefficients"], course is not None and course.kind == "dying_out"
        names = list(found) if dying else [c.name for c in effect.coefficients]
        values = np.array([float(found[name]) for name in names])
    except (KeyError, TypeError, ValueError) as error:
        raise UsageError(
            f"Estimate {estimate.source}: one of its effects is not understood ({error}); diagnose the run again with this version."
        ) from error
    return AppliedEffect(effect, place, values, shape, course)


def _index(name: str | None, robot: Robot) -> int | None:
    return None if name is None else robot.joint_names.index(name)


def _course(entry: dict[str, Any]) -> Course:
    tau = entry["time_constant_s"]
    return Course(
        entry["kind"], None if tau is None else float(tau), float(entry["start_s"]), float(entry["span_s"])
    )
