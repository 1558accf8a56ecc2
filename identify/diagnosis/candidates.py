"""Candidates of the directed tests: every effect at every place, on a grid of its shapes."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import special

from identify.adequacy import bartlett
from identify.diagnosis.problem import Problem
from identify.physics.effect import Effect, Place
from identify.rotations import FloatArray

# a column of which the baseline swallows more than this share leaves nothing that a test could see
_SWALLOWED = 1.0 - 1e-5
# two columns of one effect closer than this are one
_SAME = 1e-6
_CORRELATED_SHARE = 100  # of a run without replicates: how far its residual stays correlated


def log_chance(gain: FloatArray, width: int) -> FloatArray:
    """Logarithm of the chi-square probability of gains with a number of degrees of freedom.

    Args:
        gain: drops in chi-square, any shape.
        width: degrees of freedom.

    Returns:
        Natural logarithms, same shape; finite also where the probability underflows.
    """
    if width == 1:
        return np.log(2.0) + special.log_ndtr(-np.sqrt(gain))
    chance = special.chdtrc(width, gain)
    half, x = 0.5 * width, 0.5 * np.maximum(gain, 1e-300)
    tail = (half - 1.0) * np.log(x) - x - special.gammaln(half)  # leading term far out, where the function underflows
    return np.where(chance > 1e-290, np.log(np.maximum(chance, 1e-300)), tail)


@dataclass(frozen=True)
class Trial:
    """One candidate at one shape, projected off the baseline.

    Attributes:
        effect: the effect.
        place: where.
        shape: values of its nonlinear parameters.
        kept: which of its coefficients the data see beyond the baseline, shape (j,).
        basis: orthonormal basis of the projected columns, shape (rows, j).
        triangle: projected columns = basis @ triangle, shape (j, j).
        gain: drop in chi-square.
        values: all coefficients, 0 where not kept, shape (k,).
        norms: whitened norm of each kept column before projection, shape (j,).
    """

    effect: Effect
    place: Place
    shape: Mapping[str, float]
    kept: FloatArray
    basis: FloatArray
    triangle: FloatArray
    gain: float
    values: FloatArray
    norms: FloatArray

    @property
    def log_p(self) -> float:
        """Natural logarithm of the chi-square probability of its gain at this shape."""
        return float(log_chance(np.array(self.gain), max(len(self.kept), 1)))

    @property
    def penalised(self) -> float:
        """Gain less the price of its parameters (BIC with as many observations as rows)."""
        return self.gain - (len(self.kept) + len(self.effect.shapes)) * float(np.log(self.basis.shape[0]))

    @property
    def key(self) -> tuple[str, Place]:
        """What and where."""
        return self.effect.name, self.place


def shapes_of(effect: Effect) -> list[dict[str, float]]:
    """All grid points of an effect's shape parameters."""
    names = [shape.name for shape in effect.shapes]
    return [dict(zip(names, point, strict=True)) for point in itertools.product(*(s.grid for s in effect.shapes))]


def at_an_end(effect: Effect, shape: Mapping[str, float]) -> bool:
    """Whether a continuous shape stands at an end of its range: without replicates that is no evidence."""
    return any(
        s.continuous and len(s.grid) > 3 and np.isclose(shape[s.name], (s.grid[0], s.grid[-1]), rtol=0.03, atol=0.0).any()
        for s in effect.shapes
    )


def project(basis: FloatArray, columns: FloatArray) -> FloatArray:
    """Take the baseline out of columns, twice for rounding's sake."""
    columns = columns - basis @ (basis.T @ columns)
    return columns - basis @ (basis.T @ columns)


def trial(
    problem: Problem,
    basis: FloatArray,
    residual: FloatArray,
    effect: Effect,
    place: Place,
    shape: Mapping[str, float],
    columns: FloatArray | None = None,
    projected: FloatArray | None = None,
) -> Trial | None:
    """Test one candidate at one shape.

    Args:
        problem: the problem.
        basis: orthonormal basis of what is already in the model, shape (rows, r).
        residual: whitened residual orthogonal to it, shape (rows,).
        effect: the effect.
        place: where.
        shape: its nonlinear parameters.
        columns: its whitened columns, computed here when not given.
        projected: the same off the basis, likewise.

    Returns:
        The trial, its gain 0 where the fitted values are not physical; None where the baseline swallows it.

    Source:
        Added-variable test: gain = |P_MX r|^2, chi-square with k degrees of freedom under the null.
    """
    columns = problem.columns(effect, place, shape) if columns is None else columns
    norms = np.linalg.norm(columns, axis=0)
    seen = np.flatnonzero(norms > 1e-12)
    if len(seen) == 0 or not np.isfinite(norms).all():
        return None
    rest = project(basis, columns[:, seen]) if projected is None else projected[:, seen]
    q, r, order = _pivoted(rest)
    sizes = np.abs(np.diag(r))
    enough = sizes > np.maximum(np.sqrt(1.0 - _SWALLOWED) * norms[seen][order], _SAME * sizes.max(initial=0.0))
    count = int(np.argmin(enough)) if not enough.all() else len(enough)
    if count == 0:
        return None
    kept = seen[order[:count]]
    return _physical(problem, effect, place, shape, kept, q[:, :count], r[:count, :count], residual, norms[kept])


def _pivoted(columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    from scipy.linalg import qr

    norms = np.linalg.norm(columns, axis=0)
    safe = np.where(norms > 0, norms, 1.0)
    if columns.shape[1] == 1:
        return columns / safe, np.diag(norms), np.array([0])
    q, r, order = qr(columns / safe, mode="economic", pivoting=True)
    return q, r * safe[order], order


def _inflation(problem: Problem, q: FloatArray, rest: FloatArray) -> FloatArray:
    """How much the variance of each direction exceeds that of white noise, shape (j,); 1 with replicates.

    Without replicates the residual's own correlation stands for the noise's: Newey-West over the scores of the
    direction, the effect itself taken out.
    """
    if problem.fit.replicated:
        return np.ones(q.shape[1])
    total, first = np.zeros(q.shape[1]), 0
    for block in problem.blocks:
        channels, count = block.target.shape
        rows = slice(first, first + channels * count)
        scores = (q[rows] * rest[rows, None]).reshape(channels, count, -1)
        for part in scores:
            total += np.diag(bartlett(part, max(count // _CORRELATED_SHARE, 2)))
        first += channels * count
    return np.maximum(total, 1.0)


def _physical(
    problem: Problem,
    effect: Effect,
    place: Place,
    shape: Mapping[str, float],
    kept: FloatArray,
    q: FloatArray,
    r: FloatArray,
    residual: FloatArray,
    norms: FloatArray,
) -> Trial:
    """Fit the kept columns; where signs are violated drop those columns and fit again."""
    for _ in range(len(kept)):
        toward = q.T @ residual
        values = np.zeros(len(effect.coefficients))
        values[kept] = np.linalg.solve(r, toward)
        gain = float(np.sum(toward**2 / _inflation(problem, q, residual - q @ toward)))
        if effect.allowed(problem.scene, place, values, shape):
            return Trial(effect, place, shape, kept, q, r, gain, values, norms)
        signs = np.array([effect.coefficients[k].sign for k in kept])
        fine = signs * values[kept] >= 0.0
        if fine.all() or not fine.any():
            break
        q, r = np.linalg.qr(q @ r[:, fine])
        kept, norms = kept[fine], norms[fine]
    return Trial(effect, place, shape, kept, q, r, 0.0, np.zeros(len(effect.coefficients)), norms)


def all_trials(
    problem: Problem, basis: FloatArray, residual: FloatArray, effects: Iterable[Effect], cache: dict
) -> list[Trial]:
    """Test every effect at every place and grid point.

    Args:
        problem: the problem.
        basis: what is already in the model.
        residual: its residual.
        effects: the effects to try.
        cache: whitened columns from an earlier pass, filled here.

    Returns:
        The trials that the baseline does not swallow.
    """
    keys: list[tuple[Effect, Place, dict[str, float]]] = []
    inside = problem.fit.replicated
    for effect in (item for item in effects if not item.progressive):
        shapes = shapes_of(effect)
        for place in effect.places(problem.scene):
            keys += [(effect, place, shape) for shape in shapes if inside or not at_an_end(effect, shape)]
    columns = []
    for effect, place, shape in keys:
        key = (effect.name, place, tuple(shape.values()))
        if key not in cache:
            cache[key] = problem.columns(effect, place, shape)
        columns.append(cache[key])
    if not columns:
        return []
    projected = project(basis, np.hstack(columns))  # one product for all: many small ones are bound by memory
    result, first = [], 0
    for (effect, place, shape), own in zip(keys, columns, strict=True):
        last = first + own.shape[1]
        found = trial(problem, basis, residual, effect, place, shape, own, projected[:, first:last])
        if found is not None:
            result.append(found)
        first = last
    return result


def refine(problem: Problem, basis: FloatArray, residual: FloatArray, start: Trial) -> Trial:
    """Optimise a candidate's continuous shape parameters between the neighbours of its grid point.

    Args:
        problem: the problem.
        basis: what is already in the model.
        residual: its residual.
        start: the best grid point.

    Returns:
        The refined trial, never worse than the start.
    """
    from scipy.optimize import minimize, minimize_scalar

    free = [shape for shape in start.effect.shapes if shape.continuous and len(shape.grid) > 1]
    if not free or start.gain <= 0.0:
        return start
    best = [start]
    bounds = [_neighbours(shape.grid, start.shape[shape.name]) for shape in free]

    def cost(point: FloatArray) -> float:
        shape = dict(start.shape) | {s.name: float(v) for s, v in zip(free, np.atleast_1d(point), strict=True)}
        found = trial(problem, basis, residual, start.effect, start.place, shape)
        if found is None:
            return 0.0
        if found.gain > best[0].gain:
            best[0] = found
        return -found.gain

    if len(free) == 1:
        minimize_scalar(cost, bounds=bounds[0], method="bounded", options={"maxiter": 12})
    else:
        x0 = [start.shape[s.name] for s in free]
        minimize(cost, x0, method="Nelder-Mead", bounds=bounds, options={"maxfev": 40, "xatol": 1e-4, "fatol": 0.05})
    return best[0]


def _neighbours(grid: tuple[float, ...], value: float) -> tuple[float, float]:
    points = np.asarray(grid)
    index = int(np.argmin(np.abs(points - value)))
    return float(points[max(index - 1, 0)]), float(points[min(index + 1, len(points) - 1)])


def best_by_place(trials: Iterable[Trial]) -> list[Trial]:
    """Keep the best shape of every effect and place, best first."""
    best: dict[tuple[str, Place], Trial] = {}
    for item in trials:
        if item.key not in best or item.gain > best[item.key].gain:
            best[item.key] = item
    return sorted(best.values(), key=lambda item: item.log_p)
