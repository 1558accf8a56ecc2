"""Coordinates in which 'is a possible body' is 'is a positive definite 4 x 4 matrix near the identity'."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.inertia import pseudo_inertia
from identify.prior_bodies import Prior
from identify.rotations import FloatArray

SIZE = 10  # entries of a symmetric 4 x 4 matrix
_ROWS, _COLUMNS = np.tril_indices(4)
_WEIGHT = np.where(_ROWS == _COLUMNS, 1.0, np.sqrt(2.0))
IDENTITY = np.where(_ROWS == _COLUMNS, 1.0, 0.0)


def _basis() -> FloatArray:
    """Orthonormal symmetric matrices, shape (10, 4, 4): off-diagonal entries count sqrt(2)."""
    result = np.zeros((SIZE, 4, 4))
    for k, (row, column, weight) in enumerate(zip(_ROWS, _COLUMNS, _WEIGHT, strict=True)):
        result[k, row, column] = result[k, column, row] = 1.0 / weight
    return result


BASIS = _basis()


def matrix_of(entries: FloatArray) -> FloatArray:
    """Give the symmetric 4 x 4 matrices of scaled entries, shape (..., 10) -> (..., 4, 4)."""
    return np.tensordot(entries, BASIS, axes=1)


@dataclass(frozen=True)
class BodySpace:
    """Scaled coordinates z: per link the entries of R^-T P R^-1, where R'R is the prior's pseudo-inertia P.

    The prior is z = identity for every link and 1 for every rotor, whatever units and sizes the links have.

    Attributes:
        links: number of links n.
        rotors: number of unknown rotors u.
        to_raw: raw parameters (10 n + u) = to_raw @ z, shape (10 n + u, 10 n + u).
    """

    links: int
    rotors: int
    to_raw: FloatArray

    @property
    def prior(self) -> FloatArray:
        """Coordinates of the prior, shape (10 n + u,)."""
        return np.concatenate([np.tile(IDENTITY, self.links), np.ones(self.rotors)])

    def matrices(self, z: FloatArray) -> FloatArray:
        """Scaled pseudo-inertias, shape (n, 4, 4)."""
        return matrix_of(z[: SIZE * self.links].reshape(self.links, SIZE))

    def margin(self, z: FloatArray) -> float:
        """Smallest eigenvalue over all links and rotors: positive where every body is possible."""
        eigenvalues = np.linalg.eigvalsh(self.matrices(z))
        return float(min(eigenvalues.min(), z[SIZE * self.links :].min(initial=np.inf)))


def onto(rows: FloatArray, values: FloatArray, z: FloatArray) -> FloatArray:
    """Move z by the least that gives functionals their values to rounding.

    Args:
        rows: independent functionals, shape (k, Z).
        values: what they must be, shape (k,).
        z: a point that nearly has them, shape (Z,).

    Returns:
        The point, shape (Z,).
    """
    if len(rows) == 0:
        return z
    norms = np.linalg.norm(rows, axis=1)
    q, r = np.linalg.qr((rows / norms[:, None]).T)
    for _ in range(2):  # the second step removes the rounding of the first
        z = z + q @ np.linalg.solve(r.T, (values - rows @ z) / norms)
    return z


def body_space(prior: Prior) -> BodySpace:
    """Choose the coordinates in which a prior is the identity.

    Args:
        prior: positive definite bodies.

    Returns:
        The coordinates.

    Source:
        Congruence leaves definiteness unchanged: Wensing, Kim, Slotine, IEEE RA-L 3(1) 2018.
    """
    n, u = len(prior.links), len(prior.rotors)
    to_raw = np.zeros((SIZE * n + u, SIZE * n + u))
    # ten parameters -> scaled entries, column by column, then inverted
    for k, body in enumerate(prior.links):
        root = np.linalg.inv(np.linalg.cholesky(pseudo_inertia(body)))
        columns = [root @ pseudo_inertia(unit) @ root.T for unit in np.eye(SIZE)]
        forward = np.array([matrix[_ROWS, _COLUMNS] * _WEIGHT for matrix in columns]).T
        block = slice(SIZE * k, SIZE * k + SIZE)
        to_raw[block, block] = np.linalg.inv(forward)
    to_raw[SIZE * n :, SIZE * n :] = np.diag(prior.rotors)
    return BodySpace(n, u, to_raw)
