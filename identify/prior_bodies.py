"""Prior bodies: what a link is taken to be where the data leave it open; also the unit of its inertia."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from identify.inertia import parameters_from_body, pseudo_inertia
from identify.parameters import unknown_rotors
from identify.robot import Robot
from identify.rotations import FloatArray

# radius of gyration over length of a thick rod: compact, yet far from every boundary of what is possible
_GYRATION = 0.3
_NO_LENGTH_M = 0.3  # a chain without any link length: size of a table-top arm's link
_LEAST_MASS = 0.05  # of the heaviest link's: the data may say nothing about a link's mass
_ROTOR_SHARE = 0.05  # a rotor's reflected inertia over that of the link it drives


@dataclass(frozen=True)
class Prior:
    """Positive definite bodies, one a link.

    Attributes:
        links: the ten parameters of every link, shape (n, 10).
        rotors: inertias of the rotors that are unknown [kg.m2], shape (u,).
        from_reference: which links are the description's own inertials, shape (n,).
    """

    links: FloatArray
    rotors: FloatArray
    from_reference: FloatArray

    @property
    def sentence(self) -> str:
        """Where the bodies come from."""
        compact = "compact bodies along the links, their masses fitted to the estimate"
        if self.from_reference.all():
            return "the inertials of the robot's URDF"
        if not self.from_reference.any():
            return compact
        return f"the inertials of the robot's URDF where it has any, else {compact}"


def _is_body(parameters: FloatArray) -> bool:
    if not np.isfinite(parameters).all():
        return False
    eigenvalues = np.linalg.eigvalsh(pseudo_inertia(parameters))
    return bool(eigenvalues[0] > 1e-9 * eigenvalues[-1])


def _compact_bodies(robot: Robot) -> tuple[FloatArray, FloatArray]:
    """Unit-mass bodies half-way to the next joint, shape (n, 10), and their lengths [m], shape (n,)."""
    reach = [joint.translation_m for joint in robot.joints[1:]] + [np.zeros(3)]
    lengths = np.array([np.linalg.norm(step) for step in reach])
    known = lengths[lengths > 1e-3]
    typical = float(known.mean()) if len(known) else _NO_LENGTH_M
    lengths = np.where(lengths > 1e-3, lengths, typical)
    bodies = [
        parameters_from_body(1.0, 0.5 * step, 2.0 * (_GYRATION * length) ** 2 * np.eye(3), np.eye(3))
        for step, length in zip(reach, lengths, strict=True)
    ]
    return np.array(bodies), lengths


def prior_bodies(robot: Robot, rows: FloatArray, values: FloatArray) -> Prior:
    """Give every link a body: the description's own inertial where it is one, else a compact body.

    Args:
        robot: the chain.
        rows: functionals of the estimated base parameters in units of their std, shape (k, 10 n + u).
        values: their values in units of their std, shape (k,).

    Returns:
        The prior.
    """
    n, unknown = robot.n, unknown_rotors(robot)
    compact, lengths = _compact_bodies(robot)
    links = np.zeros((n, 10))
    reference = robot.reference_parameters
    own = np.array([reference is not None and _is_body(reference[k]) for k in range(n)])
    if reference is not None:
        links[own] = reference[own]
    masses = np.ones(n)
    if not own.all():
        rest = values - rows[:, : 10 * n] @ links.ravel()
        effect = np.stack([rows[:, 10 * k : 10 * k + 10] @ compact[k] for k in np.flatnonzero(~own)], axis=1)
        fitted = nnls(effect, rest)[0] if len(rows) else np.zeros(effect.shape[1])
        heaviest = max(fitted.max(initial=0.0), links[own, 0].max(initial=0.0))
        masses[~own] = np.maximum(fitted, _LEAST_MASS * heaviest) if heaviest > 0 else 1.0
        links[~own] = masses[~own, None] * compact[~own]
    scale = _ROTOR_SHARE * links[:, 0] * lengths**2
    rotors = np.array([scale[k] / robot.joints[k].drive.gear_ratio ** 2 for k in unknown])
    return Prior(links, rotors, own)
