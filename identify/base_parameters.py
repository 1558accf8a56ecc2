"""Base parameters: the combinations of link parameters that a model's rows can see.

A *functional* is a row of coefficients over the raw parameters; a base parameter is such a functional.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.rotations import FloatArray

# a unit-norm column counts as independent when this much of it is new; sampled double-precision regressors
# leave 1e-13 where it is not, genuine columns leave more than 1e-4
_INDEPENDENT = 1e-7
# columns less new than this are taken only when nothing better is left: a representative that is nearly dependent
# on the others makes definitions of huge coefficients that cancel
_CLEARLY_INDEPENDENT = 1e-2
_COEFFICIENT_ZERO = 1e-9


@dataclass(frozen=True)
class Reduction:
    """Outcome of a column reduction.

    Attributes:
        independent: indices of the columns kept, shape (r,).
        definitions: coefficients of the base parameters over all columns, shape (r, P); the identity on
            the columns kept.
    """

    independent: FloatArray
    definitions: FloatArray


def independent_columns(
    matrix: FloatArray, order: FloatArray, passes: tuple[float, ...] = (_INDEPENDENT,)
) -> list[int]:
    """Pick a maximal independent set of columns, greedily in the order given.

    Args:
        matrix: sampled regressor, shape (rows, P).
        order: indices into the columns, first choice first.
        passes: how much of a unit-norm column must be new, pass by pass over what is left.

    Returns:
        Indices of the columns picked, in the order picked.
    """
    norms = np.linalg.norm(matrix, axis=0)
    scale = norms.max(initial=0.0)
    basis = np.empty((matrix.shape[0], 0))
    picked: list[int] = []
    # numerically zero columns are left out: rounding noise must not count as rank
    left = [int(index) for index in order if norms[index] > _INDEPENDENT * scale]
    for threshold in passes:
        for index in left:
            column = matrix[:, index] / norms[index]
            for _ in range(2):  # twice is enough (Kahan)
                column = column - basis @ (basis.T @ column)
            rest = np.linalg.norm(column)
            if rest > threshold:
                basis = np.column_stack([basis, column / rest])
                picked.append(index)
        left = [index for index in left if index not in picked]
    return picked


def reduce_columns(matrix: FloatArray, order: FloatArray) -> Reduction:
    """Group dependent columns onto independent ones.

    Args:
        matrix: sampled regressor over random motions, shape (rows, P).
        order: column indices, those preferred as representatives first.

    Returns:
        Independent columns and the definitions of the base parameters.

    Source:
        Gautier, Numerical calculation of the base inertial parameters of robots, J. Robotic Systems 8(4) 1991.
    """
    picked = independent_columns(matrix, order, (_CLEARLY_INDEPENDENT, _INDEPENDENT))
    kept = matrix[:, picked]
    scale = np.linalg.norm(kept, axis=0)
    coefficients = np.linalg.lstsq(kept / scale, matrix, rcond=None)[0] / scale[:, None]
    coefficients[np.abs(coefficients) < _COEFFICIENT_ZERO] = 0.0
    coefficients[:, picked] = np.eye(len(picked))
    return Reduction(np.array(picked, dtype=int), coefficients)


def in_row_space(functionals: FloatArray, basis: FloatArray) -> FloatArray:
    """Tell which functionals are combinations of a basis.

    Args:
        functionals: shape (k, P).
        basis: shape (r, P).

    Returns:
        Booleans, shape (k,).
    """
    if len(functionals) == 0 or len(basis) == 0:
        return np.zeros(len(functionals), dtype=bool)
    q = np.linalg.qr(basis.T)[0]
    rest = functionals - (functionals @ q) @ q.T
    return np.linalg.norm(rest, axis=1) < 1e-6 * np.linalg.norm(functionals, axis=1)


def prefer(preferred: FloatArray, basis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Change a basis of functionals so that it starts with the preferred ones.

    Args:
        preferred: functionals wanted first, shape (k, P); those outside the row space are left out.
        basis: basis of the row space, shape (r, P).

    Returns:
        Indices: of the preferred functionals used (a,), and of the basis rows that complete them (r - a,).
    """
    usable = np.flatnonzero(in_row_space(preferred, basis))
    rows = np.vstack([preferred[usable], basis])
    picked = independent_columns(rows.T, np.arange(len(rows)))
    chosen = np.array([usable[k] for k in picked if k < len(usable)], dtype=int)
    completing = np.array([k - len(usable) for k in picked if k >= len(usable)], dtype=int)
    return chosen, completing
