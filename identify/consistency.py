"""Physical consistency: can bodies, friction and motors exist that have the estimated base parameters?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from identify.body_space import SIZE, BodySpace, body_space
from identify.model import Model
from identify.prior_bodies import prior_bodies
from identify.representative import nearest_to_prior
from identify.rotations import FloatArray
from identify.semidefinite import MARGIN, nearest, roundest
from identify.sign_bounds import SignBounds, sign_bounds

CONFIDENCE = 0.95
_TOUCHING = 1e-3  # std: an estimate this near to the consistent set lies on its boundary to rounding
_SINGULAR = 1e-12


@dataclass(frozen=True)
class Consistency:
    """Whether an estimate is physically possible, and the nearest one that is.

    Attributes:
        consistent: bodies with positive definite pseudo-inertia exist that have exactly the estimated
            parameters; rotor inertias, friction and torque constants have the right sign.
        within_uncertainty: such ones exist inside the estimate's confidence region.
        distance: Mahalanobis distance to the nearest consistent parameters [std], 0 where consistent.
        limit: radius of the confidence region [std].
        violations: conditions on signs that the estimate breaks, in words.
        projected: nearest consistent parameters, nan where not estimated, shape (P,).
        projected_constants: likewise the torque constants [N.m/A], nan where not estimated, shape (n,).
        shift: projected minus estimated over std, shape (P + n,).
        links: one set of bodies that has the (projected) parameters: ten parameters a link, shape (n, 10).
        rotors: and its unknown rotor inertias [kg.m2], shape (u,).
        filled: number of directions among link parameters and rotor inertias that the estimate leaves open.
        prior: what fills them, in words.
        sentence: the result in words.
    """

    consistent: bool
    within_uncertainty: bool
    distance: float
    limit: float
    violations: tuple[str, ...]
    projected: FloatArray
    projected_constants: FloatArray
    shift: FloatArray
    links: FloatArray
    rotors: FloatArray
    filled: int
    prior: str
    sentence: str


@dataclass(frozen=True)
class _Estimate:
    """What constrains the bodies: rigid base parameters first, then parameters with a prescribed sign.

    Attributes:
        values: (parameters, torque constants), nan where not estimated, shape (P + n,).
        covariance: shape (P + n, P + n).
        rigid: positions of the rigid ones, shape (k,).
        definitions: their functionals over raw parameters, shape (k, 10 n + u).
        signs: the signed ones.
    """

    values: FloatArray
    covariance: FloatArray
    rigid: FloatArray
    definitions: FloatArray
    signs: SignBounds

    @property
    def constrained(self) -> FloatArray:
        """Positions of all constrained ones."""
        return np.concatenate([self.rigid, self.signs.indices]).astype(int)

    @property
    def std(self) -> FloatArray:
        """Std of every value, nan where not estimated."""
        return np.sqrt(np.diag(self.covariance))


def _estimate(model: Model, theta: FloatArray, constants: FloatArray, covariance: FloatArray) -> _Estimate:
    values = np.concatenate([theta, constants])
    variance = np.diag(covariance)
    known = np.isfinite(values) & np.isfinite(variance) & (np.nan_to_num(variance) > 0.0)
    rigid = np.flatnonzero(known[: len(model.basis.names)])
    # what of the model's covariance is not known carries no information
    kept = np.where(np.outer(known, known), covariance, np.nan)
    signs = sign_bounds(model, known)
    return _Estimate(np.where(known, values, np.nan), kept, rigid, model.basis.definitions[rigid], signs)


def _whitening(covariance: FloatArray) -> FloatArray:
    """Give W with W C W' = identity; nearly singular directions are taken as known to rounding only."""
    std = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(std, std))
    values = np.maximum(values, _SINGULAR * values.max(initial=1.0))
    return (vectors / np.sqrt(values)).T / std


def check_consistency(
    model: Model, theta: FloatArray, covariance: FloatArray, torque_constants: FloatArray | None = None
) -> Consistency:
    """Tell whether an estimate is physically possible, and find the nearest parameters that are.

    Args:
        model: the model of the estimate.
        theta: its parameters, nan where not identifiable, shape (P,).
        covariance: of (parameters, torque constants), nan where not identifiable, shape (P + n, P + n).
        torque_constants: estimates [N.m/A], nan where there is none, shape (n,).

    Returns:
        The verdict, the projection and one full set of bodies.

    Source:
        Pseudo-inertia: Wensing, Kim, Slotine, RA-L 3(1) 2018; as a semidefinite programme: Sousa, Cortesao,
        IJRR 33(6) 2014.
    """
    n = model.robot.n
    constants = np.full(n, np.nan) if torque_constants is None else torque_constants
    estimate = _estimate(model, theta, constants, covariance)
    rigid_std = estimate.std[estimate.rigid]
    weighted = estimate.definitions / rigid_std[:, None]
    prior = prior_bodies(model.robot, weighted, estimate.values[estimate.rigid] / rigid_std)
    space = body_space(prior)
    rows = weighted @ space.to_raw
    z, moved, distance = _nearest_possible(estimate, space, rows, rigid_std)
    z = nearest_to_prior(space, rows, z)
    raw = space.to_raw @ z
    return _conclude(model, estimate, moved, distance, raw, prior.sentence)


def _nearest_possible(
    estimate: _Estimate, space: BodySpace, rows: FloatArray, rigid_std: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Bodies, (projected parameters, torque constants) and distance."""
    signed = estimate.values[estimate.signs.indices]
    if not estimate.signs.violations(signed):
        z = roundest(space, rows, estimate.values[estimate.rigid] / rigid_std)
        if space.margin(z) >= MARGIN:
            return z, estimate.values, 0.0
    places = estimate.constrained
    covariance = estimate.covariance[np.ix_(places, places)]
    whiten = _whitening(covariance)
    bounds = (estimate.signs.matrix, estimate.signs.bound)
    found = nearest(space, rows * rigid_std[:, None], bounds, whiten, estimate.values[places])
    there = np.concatenate([rigid_std * (rows @ found.z), found.signed])
    return found.z, _carry_along(estimate, whiten, there), found.distance


def _carry_along(estimate: _Estimate, whiten: FloatArray, there: FloatArray) -> FloatArray:
    """Move the unconstrained estimates with the constrained ones, as their covariance says."""
    places = estimate.constrained
    shift = whiten.T @ (whiten @ (there - estimate.values[places]))
    known = np.isfinite(estimate.values)
    result = estimate.values.copy()
    result[known] += estimate.covariance[np.ix_(known, places)] @ shift
    result[places] = there
    return result


def _conclude(
    model: Model, estimate: _Estimate, moved: FloatArray, distance: float, raw: FloatArray, prior: str
) -> Consistency:
    n, count = model.robot.n, len(model.parameters)
    broken = estimate.signs.violations(estimate.values[estimate.signs.indices])
    consistent = not broken and distance < _TOUCHING
    constrained = len(estimate.constrained)
    limit = float(np.sqrt(chi2.ppf(CONFIDENCE, constrained))) if constrained else float("inf")
    shift = (moved - estimate.values) / estimate.std
    rank = np.linalg.matrix_rank(estimate.definitions) if len(estimate.definitions) else 0
    verdict = consistent or distance <= limit
    return Consistency(
        consistent,
        bool(verdict),
        0.0 if consistent else distance,
        limit,
        broken,
        moved[:count],
        moved[count:],
        shift,
        raw[: SIZE * n].reshape(n, SIZE),
        raw[SIZE * n :],
        len(raw) - int(rank),
        prior,
        _sentence(model, consistent, distance, limit, broken, shift),
    )


def _sentence(
    model: Model, consistent: bool, distance: float, limit: float, broken: tuple[str, ...], shift: FloatArray
) -> str:
    if consistent:
        return (
            "consistent: bodies with positive mass and positive definite pseudo-inertia exist that have "
            "exactly these base parameters, and friction and motor constants have the right sign."
        )
    names = [parameter.name for parameter in model.parameters]
    names += [f"{joint}.torque_constant" for joint in model.robot.joint_names]
    worst = int(np.nanargmax(np.abs(shift)))
    impossible = "no bodies with positive definite pseudo-inertia have these base parameters"
    cause = "; ".join(broken) or impossible
    moves = f"the largest shift to get there is {names[worst]} by {shift[worst]:+.2g} std"
    if distance <= limit:
        return (
            f"inconsistent at the estimate but within its uncertainty: {cause}; consistent parameters lie "
            f"{distance:.2g} std away, inside the {CONFIDENCE:.0%} region of {limit:.2g} std; {moves}."
        )
    return (
        f"inconsistent: {cause}; the nearest consistent parameters lie {distance:.3g} std away, outside the "
        f"{CONFIDENCE:.0%} region of {limit:.2g} std, so a structural error (geometry, friction, timing) is "
        f"likely; {moves}."
    )
