"""The model with the named effects in it: one joint fit of everything, with one covariance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from identify.diagnosis.candidates import Trial
from identify.diagnosis.problem import Problem
from identify.fit import Fit
from identify.physics.effect import Effect, Place
from identify.physics.scene import Scene
from identify.rotations import FloatArray
from identify.solve import whitened_system

_ITERATIONS = 5
_RENEWALS = 3  # rounds around the joint fit: strong effects move the torque constants far
_TRUST = 0.3  # relative change of a shape parameter that one step may make


@dataclass(frozen=True)
class Addition:
    """One effect in the joint fit.

    Attributes:
        effect: the effect.
        place: where.
        values: its coefficients, shape (k,).
        value_std: their std, shape (k,); inf where the data do not see it.
        shape: its nonlinear parameters.
        shape_std: their std; inf where the data do not see it, 0 for a chosen order.
        delta_chi2: what the fit loses without it.
        freedom: number of its parameters.
    """

    effect: Effect
    place: Place
    values: FloatArray
    value_std: FloatArray
    shape: Mapping[str, float]
    shape_std: Mapping[str, float]
    delta_chi2: float
    freedom: int


@dataclass(frozen=True)
class Augmented:
    """Joint fit of baseline and effects.

    Attributes:
        theta: baseline parameters, shape (P,).
        scale: torque-constant scales, shape (n,).
        baseline_covariance: of (theta, free scales), shape (P + k, P + k).
        additions: the effects.
        covariance: of the effects' free parameters in order (coefficients kept, then continuous shapes), per addition stacked.
        names: names of those parameters, ``effect@place.parameter``.
        residual: whitened residual, shape (rows,).
        chi2: its square.
        joint_covariance: of (theta, free scales, the effects' free parameters), all of one fit.
    """

    theta: FloatArray
    scale: FloatArray
    baseline_covariance: FloatArray
    additions: tuple[Addition, ...]
    covariance: FloatArray
    names: tuple[str, ...]
    residual: FloatArray
    chi2: float
    joint_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass
class _Member:
    """An effect while the joint fit moves its shape."""

    effect: Effect
    place: Place
    kept: list[int]
    values: FloatArray
    shape: dict[str, float]

    @property
    def free_shapes(self) -> list[str]:
        return [s.name for s in self.effect.shapes if s.continuous and len(s.grid) > 1]

    def bounds(self, name: str) -> tuple[float, float]:
        grid = next(s.grid for s in self.effect.shapes if s.name == name)
        return min(grid), max(grid)

    def system(self, problem: Problem) -> tuple[FloatArray, FloatArray]:
        """Whitened columns (rows, kept) and tangents (rows, shapes)."""
        columns = problem.columns(self.effect, self.place, self.shape)
        tangents = []
        for name in self.free_shapes:
            step = 0.01 * max(abs(self.shape[name]), 1e-9)
            ahead, behind = (
                problem.columns(self.effect, self.place, self.shape | {name: self.shape[name] + sign * step}) for sign in (1, -1)
            )
            tangents.append((ahead - behind) @ self.values / (2.0 * step))
        tangent = np.stack(tangents, axis=1) if tangents else np.zeros((len(columns), 0))
        return columns[:, self.kept], tangent


def _solve(matrix: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least squares with column scaling: solution and covariance, inf variances where nothing is seen."""
    norms = np.linalg.norm(matrix, axis=0)
    safe = np.where(norms > 1e-12 * norms.max(initial=1e-300), norms, np.inf)
    left, values, rows = np.linalg.svd(matrix / safe, full_matrices=False)
    seen = values > 1e-9 * values[0]
    solution = (rows[seen].T @ ((left[:, seen].T @ right) / values[seen])) / safe
    root = rows[seen].T / values[seen] / safe[:, None]
    return solution, root @ root.T


def augment(problem: Problem, trials: list[Trial]) -> Augmented:
    """Fit baseline and effects together, shapes included.

    Args:
        problem: the problem.
        trials: the effects with their shapes so far.

    Returns:
        The joint fit; without effects simply the baseline.
    """
    members = [_Member(t.effect, t.place, sorted(int(k) for k in t.kept), t.values.copy(), dict(t.shape)) for t in trials]
    base = problem.jacobian
    best = (np.inf, [dict(member.shape) for member in members])
    for _ in range(_ITERATIONS):
        matrix, parts = _joint(problem, members, base)
        chi2 = _at_these_shapes(matrix, parts, base.shape[1], problem.residual)
        if chi2 < best[0]:
            best = (chi2, [dict(member.shape) for member in members])
        solution, covariance = _solve(matrix, problem.residual)
        if _advance(members, parts, solution, base.shape[1]) < 1e-3:
            break
    for member, shape in zip(members, best[1], strict=True):
        member.shape = shape  # a step that made things worse is taken back
    matrix, parts = _joint(problem, members, base)
    solution, covariance = _solve(matrix, problem.residual)
    _advance(members, parts, solution, base.shape[1], move=False)
    rest = problem.residual - matrix @ solution
    return _result(problem, members, parts, matrix, solution, covariance, rest)


def _at_these_shapes(matrix: FloatArray, parts: list[tuple[int, int]], first: int, residual: FloatArray) -> float:
    """Chi-square with the shapes held where they are: the tangents left out."""
    keep = list(range(first))
    for columns, tangents in parts:
        keep += range(first, first + columns)
        first += columns + tangents
    rest = residual - matrix[:, keep] @ _solve(matrix[:, keep], residual)[0]
    return float(rest @ rest)


def fit_jointly(problem: Problem, trials: list[Trial]) -> tuple[Augmented, Problem]:
    """Fit baseline and effects together where the joint fit itself lies.

    The model is bilinear in the torque constants and the effects' columns follow the fitted loads and currents, so a
    fit linearised at the baseline alone is biased by what the baseline lacked: scenes and Jacobian are renewed.

    Args:
        problem: the problem of the baseline.
        trials: the effects with their shapes so far.

    Returns:
        The joint fit, and the problem linearised at it.
    """
    result = augment(problem, trials)
    for _ in range(_RENEWALS if trials else 0):
        problem = _renewed(problem, result)
        trials = [replace(t, values=a.values, shape=a.shape) for t, a in zip(trials, result.additions, strict=True)]
        result = augment(problem, trials)
    return result, problem


def _renewed(problem: Problem, result: Augmented) -> Problem:
    """The same problem around a joint fit: its residual is that of the renewed baseline without the effects."""
    fit, solution = problem.fit, problem.fit.solution
    jacobian, rest = whitened_system(fit.rows.blocks, fit.noises, result.theta, result.scale, solution.free_scales)
    moved = replace(fit, solution=replace(solution, theta=result.theta, scale=result.scale, jacobian=jacobian, whitened=rest))
    scenes = []
    for scene in problem.scenes:
        found = sum((_drive_share(scene, a) for a in result.additions), np.zeros(1))
        theta = np.where(solution.identifiable[: len(result.theta)], result.theta, 0.0)
        scenes.append(replace(scene, theta=theta, scale=result.scale, found=found if np.ndim(found) == 2 else None))
    return Problem(moved, tuple(scenes), problem.extra)


def _drive_share(scene: Scene, item: Addition) -> FloatArray:
    """What an effect adds to the drive torques, shape (n, B)."""
    columns = item.effect.columns(scene, item.place, item.shape)[: scene.robot.n]
    return np.tensordot(columns, item.values, axes=([1], [0]))


def _without_extra(covariance: FloatArray, base: int, whole: int) -> FloatArray:
    """Leave the nuisance columns of a diagnosis out of a joint covariance."""
    keep = np.r_[0:base, whole : len(covariance)]
    return covariance[np.ix_(keep, keep)]


def unaugmented(fit: Fit) -> Augmented:
    """The baseline in the form of a joint fit without effects."""
    solution, count = fit.solution, len(fit.model.parameters)
    theta = np.where(solution.identifiable[:count], solution.theta, 0.0)
    return Augmented(
        theta, solution.scale, solution.covariance, (), np.zeros((0, 0)), (), solution.whitened, solution.chi2, solution.covariance
    )


def _joint(problem: Problem, members: list[_Member], base: FloatArray) -> tuple[FloatArray, list[tuple[int, int]]]:
    blocks, parts = [base], []
    for member in members:
        columns, tangents = member.system(problem)
        blocks += [columns, tangents]
        parts.append((columns.shape[1], tangents.shape[1]))
    return np.hstack(blocks), parts


def _advance(members: list[_Member], parts: list[tuple[int, int]], solution: FloatArray, first: int, move: bool = True) -> float:
    """Take over coefficients and (bounded) shape steps; returns the largest relative shape step."""
    largest = 0.0
    for member, (columns, tangents) in zip(members, parts, strict=True):
        member.values = np.zeros(len(member.effect.coefficients))
        member.values[member.kept] = solution[first : first + columns]
        for name, step in zip(member.free_shapes, solution[first + columns : first + columns + tangents], strict=True):
            if not move:
                continue
            old = member.shape[name]
            low, high = member.bounds(name)
            allowed = _TRUST * max(abs(old), 1e-9)
            new = float(np.clip(old + np.clip(step, -allowed, allowed), low, high))
            largest = max(largest, abs(new - old) / max(abs(old), 1e-9))
            member.shape[name] = new
        first += columns + tangents
    return largest


def _result(
    problem: Problem,
    members: list[_Member],
    parts: list[tuple[int, int]],
    matrix: FloatArray,
    solution: FloatArray,
    covariance: FloatArray,
    rest: FloatArray,
) -> Augmented:
    fit = problem.fit
    base, count = fit.solution.jacobian.shape[1], len(fit.model.parameters)
    whole = problem.jacobian.shape[1]  # with what joined the baseline for this diagnosis
    scale = fit.solution.scale.copy()
    scale[fit.solution.free_scales] += solution[count:base]
    theta = np.where(fit.solution.identifiable[:count], fit.solution.theta + solution[:count], fit.solution.theta)
    additions, names, first = [], [], whole
    chi2 = float(rest @ rest)
    for member, (columns, tangents) in zip(members, parts, strict=True):
        own = slice(first, first + columns + tangents)
        others = np.delete(matrix, np.arange(own.start, own.stop), axis=1)
        without = problem.residual - others @ _solve(others, problem.residual)[0]
        std = np.sqrt(np.diag(covariance)[own])
        value_std = np.full(len(member.effect.coefficients), np.inf)
        value_std[member.kept] = std[:columns]
        shape_std = {s.name: 0.0 for s in member.effect.shapes}
        shape_std |= {name: float(s) if s > 0 else np.inf for name, s in zip(member.free_shapes, std[columns:], strict=True)}
        additions.append(
            Addition(
                member.effect, member.place, member.values.copy(), value_std, dict(member.shape), shape_std,
                float(without @ without) - chi2, columns + tangents,
            )
        )
        label = f"{member.effect.name}@{member.place.joint if member.place.joint is not None else member.place.channel or 'robot'}"
        names += [f"{label}.{member.effect.coefficients[k].name}" for k in member.kept]
        names += [f"{label}.{name}" for name in member.free_shapes]
        first = own.stop
    return Augmented(
        theta, scale, covariance[:base, :base], tuple(additions), covariance[whole:, whole:], tuple(names), rest, chi2, _without_extra(covariance, base, whole)
    )
