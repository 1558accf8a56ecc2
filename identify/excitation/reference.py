"""The reference model: what torques to expect before anything was measured.

It serves two purposes: a column of a torque constant is the torque that the current stands for, and a
torque limit needs a prediction. The design states where it comes from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from identify.excitation.errors import DesignError
from identify.excitation.limits import MotionLimits
from identify.inertia import parameters_from_body
from identify.model import Model
from identify.parameters import raw_rigid_parameters
from identify.robot import Robot
from identify.rotations import FloatArray

# the guess where nothing is known: uniform links, their density such that the rigid torques reach this share
# of the effort limits on random motions; Coulomb friction and viscous friction at top speed this share
_EFFORT_SHARE, _FRICTION_SHARE = 0.5, 0.06
_DENSITY_KG_M = (
    30.0  # per metre of link where no effort limit scales it: an industrial arm of the 10 kg class
)
_SHORTEST_M, _RADIUS_SHARE, _LATERAL = 0.15, 0.15, 0.1
_SAMPLES, _SEED = 200, 1


@dataclass(frozen=True)
class ReferenceModel:
    """Parameter values to expect.

    Attributes:
        theta: in the order of the model's parameters, shape (P,).
        source: ``urdf``, ``estimate`` or ``nominal guess``.
        sentence: where the values come from, for the reader of the design.
    """

    theta: FloatArray
    source: str
    sentence: str


def nominal_links(robot: Robot) -> FloatArray:
    """Guess link parameters: uniform cylinders from joint to joint of unit guess density, shape (n, 10)."""
    spans = [joint.translation_m for joint in robot.joints[1:]]
    typical = float(np.mean([np.linalg.norm(span) for span in spans])) if spans else 0.3
    spans = [*spans, np.array([0.0, 0.0, max(typical, _SHORTEST_M)])]
    links = []
    for span in spans:
        length = max(float(np.linalg.norm(span)), _SHORTEST_M)
        along = span / np.linalg.norm(span) if np.linalg.norm(span) > 1e-6 else np.array([0.0, 0.0, 1.0])
        mass, radius = _DENSITY_KG_M * length, _RADIUS_SHARE * length
        # off the axis as real links are: else first moments vanish, and their columns in the torque with them
        com = 0.5 * span + _LATERAL * length * np.array([1.0, -1.0, 0.5])
        across = mass * (3.0 * radius**2 + length**2) / 12.0
        inertia = across * np.eye(3) + (0.5 * mass * radius**2 - across) * np.outer(along, along)
        links.append(parameters_from_body(mass, com, inertia, np.eye(3)))
    return np.array(links)


def _theta(model: Model, links: FloatArray, friction: Mapping[str, float]) -> FloatArray:
    """Values of the model's parameters from link parameters; unknown rotors count as nothing."""
    raw = dict.fromkeys((name for name, _ in raw_rigid_parameters(model.robot)), 0.0)
    names = [name for name, _ in raw_rigid_parameters(model.robot)][: links.size]
    raw |= dict(zip(names, links.ravel(), strict=True)) | friction
    return np.array(
        [sum(share * raw.get(name, 0.0) for name, share in p.definition.items()) for p in model.parameters]
    )


def drive_torque(
    model: Model,
    theta: FloatArray,
    q: FloatArray,
    qd: FloatArray,
    qdd: FloatArray,
    sign: FloatArray | None = None,
) -> FloatArray:
    """Predict the drive torques [N.m or N], shape (n, N)."""
    rows = model.drive_rows(q, qd, qdd, sign)
    return np.einsum("cpn,p->cn", rows.columns, theta) + rows.known


def _random_torques(model: Model, limits: MotionLimits, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Peak torques that theta causes, and that the known rotors cause, on random motions, each (n,)."""
    rng = np.random.default_rng(_SEED)
    q = rng.uniform(limits.lower[:, None], limits.upper[:, None], (model.robot.n, _SAMPLES))
    top, hard = np.minimum(limits.velocity, 3.0), np.minimum(limits.acceleration, 10.0)
    qd = top[:, None] * rng.uniform(-1.0, 1.0, q.shape)
    qdd = hard[:, None] * rng.uniform(-1.0, 1.0, q.shape)
    known = drive_torque(model, np.zeros_like(theta), q, qd, qdd)
    return np.abs(drive_torque(model, theta, q, qd, qdd) - known).max(axis=1), np.abs(known).max(axis=1)


def _friction_guess(model: Model, limits: MotionLimits, scale_nm: FloatArray) -> dict[str, float]:
    guess = {}
    for k, joint in enumerate(model.robot.joints):
        level = _FRICTION_SHARE * (limits.effort[k] if np.isfinite(limits.effort[k]) else scale_nm[k])
        speed = limits.velocity[k] if np.isfinite(limits.velocity[k]) else 1.0
        guess |= {f"{joint.name}.coulomb": level, f"{joint.name}.viscous": level / speed}
    return guess


def reference_from_description(model: Model, limits: MotionLimits) -> ReferenceModel:
    """Take the URDF's inertials, or guess links where it has none; friction is a stated guess either way.

    Args:
        model: the model the design is for.
        limits: motion limits; effort limits scale the guess.

    Returns:
        The reference model.
    """
    given = model.robot.reference_parameters
    guessed = nominal_links(model.robot)
    missing = np.ones(model.robot.n, dtype=bool) if given is None else ~np.isfinite(given).all(axis=1)
    links = guessed if given is None else np.where(missing[:, None], guessed, given)
    density = 1.0
    if missing.all():
        peak, known = _random_torques(model, limits, _theta(model, links, {}))
        room = (_EFFORT_SHARE * limits.effort - known) / np.maximum(peak, 1e-9)
        density = float(np.clip(room.min(), 0.05, 20.0)) if np.isfinite(room.min()) else 1.0
        links = density * links
    peak, _ = _random_torques(model, limits, _theta(model, links, {}))
    theta = _theta(model, links, _friction_guess(model, limits, peak))
    friction = f"friction guessed as {_FRICTION_SHARE:.0%} of the effort limits"
    if not missing.any():
        return ReferenceModel(theta, "urdf", f"Inertials of the URDF; {friction}.")
    share = (
        "the URDF has no inertials" if missing.all() else f"{missing.sum()} links lack inertials in the URDF"
    )
    return ReferenceModel(
        theta,
        "nominal guess",
        f"A nominal guess, since {share}: uniform links of {density * _DENSITY_KG_M:.3g} kg/m in total "
        f"{links[:, 0].sum():.3g} kg, scaled from the effort limits; {friction}.",
    )


def reference_from_estimate(model: Model, values: Mapping[str, float], where: str) -> ReferenceModel:
    """Take the values of an earlier estimate.

    Args:
        model: the model the design is for.
        values: parameter values by name; parameters of the plate may be missing.
        where: the estimate's place, for messages.

    Returns:
        The reference model.

    Raises:
        DesignError: a parameter is missing there.
    """
    missing = [p.name for p in model.parameters if p.name not in values and p.group != "plate"]
    if missing:
        raise DesignError(
            f"The estimate {where} lacks {len(missing)} of the {len(model.parameters)} "
            "parameters of this robot's "
            f"{model.kind} model, first '{missing[0]}'; give an estimate of the same robot file and model."
        )
    theta = np.array([values.get(p.name, 0.0) for p in model.parameters])
    return ReferenceModel(theta, "estimate", f"The estimate {where}.")
