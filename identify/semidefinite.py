"""The two semidefinite programmes of physical consistency: is there a body, and how far is the nearest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.body_space import BodySpace, onto
from identify.errors import IdentifyError
from identify.rotations import FloatArray

# least eigenvalue of a body in units of the prior's: thinner bodies count as flat
MARGIN = 1e-6
# price of one prior-sized body in half squared std: without it the nearest point may lie at infinite mass
_SIZE_PRICE = 1e-3
_ENOUGH = 1.0  # no need to look for a body rounder than the prior
_SOLVED = ("Solved", "AlmostSolved")


@dataclass(frozen=True)
class Nearest:
    """Point of the consistent set nearest to an estimate.

    Attributes:
        z: scaled bodies, shape (Z,).
        signed: parameters with a sign of their own, shape (s,).
        distance: Mahalanobis distance from the estimate.
    """

    z: FloatArray
    signed: FloatArray
    distance: float


def _cones(space: BodySpace) -> list[Any]:
    import clarabel  # a compiled solver: loaded only where it is needed

    cones: list[Any] = [clarabel.PSDTriangleConeT(4) for _ in range(space.links)]
    return cones + ([clarabel.NonnegativeConeT(space.rotors)] if space.rotors else [])


def _solve(
    quadratic: FloatArray, linear: FloatArray, a: FloatArray, b: FloatArray, cones: list[Any]
) -> FloatArray:
    """Minimise x'Qx/2 + c'x subject to b - A x in the cones."""
    import clarabel
    from scipy import sparse

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix(quadratic), linear, sparse.csc_matrix(a), b, cones, settings
    ).solve()
    if str(solution.status) not in _SOLVED:
        raise IdentifyError(
            f"The search for consistent bodies ended without an answer ({solution.status}); "
            "the covariance of the estimate is probably singular, use a run with more motion."
        )
    return np.array(solution.x)


def roundest(space: BodySpace, rows: FloatArray, values: FloatArray) -> FloatArray:
    """Find bodies with exactly these base parameters, as far from impossible as they can be.

    Args:
        space: coordinates.
        rows: functionals over z, shape (k, Z).
        values: what they must be, shape (k,).

    Returns:
        z, shape (Z,); possible bodies exist if its margin is positive.
    """
    import clarabel

    size, count = len(space.prior), len(rows)
    norms = np.linalg.norm(rows, axis=1)
    scaled, wanted = rows / norms[:, None], values / norms
    a = np.zeros((count + 1 + size, size + 1))
    a[:count, :size] = scaled
    a[count, size] = 1.0
    a[count + 1 :, :size] = -np.eye(size)
    a[count + 1 :, size] = space.prior
    b = np.concatenate([wanted, [_ENOUGH], np.zeros(size)])
    cones = [*([clarabel.ZeroConeT(count)] if count else []), clarabel.NonnegativeConeT(1), *_cones(space)]
    linear = np.zeros(size + 1)
    linear[size] = -1.0
    z = _solve(np.zeros((size + 1, size + 1)), linear, a, b, cones)[:size]
    return onto(scaled, wanted, z)  # to rounding, whatever the solver's tolerance


def nearest(
    space: BodySpace,
    rows: FloatArray,
    signs: tuple[FloatArray, FloatArray],
    whiten: FloatArray,
    values: FloatArray,
) -> Nearest:
    """Find the possible bodies (and signed parameters) nearest to an estimate.

    Args:
        space: coordinates.
        rows: functionals over z of the first k estimates, shape (k, Z).
        signs: G, g with G s >= g for the s signed parameters, which are the last estimates: (c, s), (c,).
        whiten: inverse Cholesky factor of the estimates' covariance, shape (k + s, k + s).
        values: the estimates, shape (k + s,).

    Returns:
        The nearest point.
    """
    import clarabel

    size, (g, bound) = len(space.prior), signs
    s, k, c = g.shape[1], len(values), len(bound)
    effect = np.zeros((k, size + s))
    effect[: len(rows), :size], effect[len(rows) :, size:] = rows, np.eye(s)
    weighted = whiten @ effect
    variables = size + s + k  # z, signed, whitened residual
    a = np.zeros((k + c + size, variables))
    a[:k, : size + s], a[:k, size + s :] = weighted, -np.eye(k)
    a[k : k + c, size : size + s] = -g
    a[k + c :, :size] = -np.eye(size)
    b = np.concatenate([whiten @ values, -bound, -MARGIN * space.prior])
    quadratic = np.zeros((variables, variables))
    quadratic[size + s :, size + s :] = np.eye(k)
    cones = [clarabel.ZeroConeT(k), *([clarabel.NonnegativeConeT(c)] if c else []), *_cones(space)]
    linear = np.concatenate([_SIZE_PRICE * space.prior, np.zeros(s + k)])
    x = _solve(quadratic, linear, a, b, cones)
    z = x[:size] + max(0.0, 0.5 * MARGIN - space.margin(x[:size])) * space.prior
    rest = whiten @ (values - effect @ np.concatenate([z, x[size : size + s]]))
    return Nearest(z, x[size : size + s], float(np.linalg.norm(rest)))


