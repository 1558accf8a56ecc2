"""Forward selection of effects, one at a time, each with its shape optimised before the next is considered."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identify.diagnosis.candidates import Trial, all_trials, at_an_end, best_by_place, project, refine, trial
from identify.diagnosis.describe import carrying_channels, contribution
from identify.diagnosis.null import FamilyNull, family_null
from identify.diagnosis.problem import Problem
from identify.physics.effect import Effect
from identify.rotations import FloatArray

_MOST = 4  # effects in one recording
_CLOSE = 12.0  # penalised gain within which candidates are refined and compared
_POLISH = 0.04  # share of a stronger effect's gain below which a further name on its channels says nothing
_RIVAL_GAP = 6.0  # BIC difference below which the data do not decide
_SIZE_FLOOR = 0.01  # of a channel's signal: systematic error that real recordings keep
_RIVAL_COSINE = 0.95


@dataclass(frozen=True)
class Named:
    """One effect accepted into the model.

    Attributes:
        trial: its fit at the moment of acceptance.
        p_value: of its gain, over the whole family.
        rivals: other candidates that the data cannot tell from it, best first.
    """

    trial: Trial
    p_value: float
    rivals: tuple[Trial, ...]


@dataclass(frozen=True)
class Selection:
    """Outcome of the selection.

    Attributes:
        named: the accepted effects in order.
        basis: baseline and accepted columns, orthonormal, shape (rows, r).
        residual: what is left, whitened, shape (rows,).
        null: the family's null distribution.
        first: all trials of the first pass, for the blind spots.
    """

    named: tuple[Named, ...]
    basis: FloatArray
    residual: FloatArray
    null: FamilyNull
    first: tuple[Trial, ...]


def tangent_columns(problem: Problem, item: Trial) -> FloatArray:
    """Whitened derivatives of an effect's contribution with respect to its continuous shapes, shape (rows, m)."""
    parts = []
    for shape in item.effect.shapes:
        if not shape.continuous or len(shape.grid) < 2:
            continue
        value = item.shape[shape.name]
        step = 0.02 * abs(value) if value else 0.02 * (shape.grid[-1] - shape.grid[0])
        ahead, behind = (
            problem.columns(item.effect, item.place, dict(item.shape) | {shape.name: value + sign * step}) for sign in (1, -1)
        )
        parts.append((ahead - behind) @ item.values / (2.0 * step))
    rows = item.basis.shape[0]
    return np.stack(parts, axis=1) if parts else np.zeros((rows, 0))


def extend(basis: FloatArray, columns: FloatArray) -> FloatArray:
    """Add columns to an orthonormal basis; directions already in it are left out."""
    rest = project(basis, columns)
    norms = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(rest / np.where(norms > 0, norms, 1.0), full_matrices=False)
    return np.hstack([basis, left[:, values > 1e-5]])


def select(problem: Problem, effects: list[Effect], level: float, rng: np.random.Generator) -> Selection:
    """Name effects one after the other while the family's best is significant.

    Args:
        problem: the problem.
        effects: the catalogue.
        level: family-wise significance level.
        rng: for the null distribution.

    Returns:
        The selection.
    """
    basis, residual, cache = problem.basis, problem.residual, {}
    named: list[Named] = []
    first: list[Trial] = []
    null = FamilyNull(1.0)
    while len(named) < _MOST:
        trials = all_trials(problem, basis, residual, effects, cache)
        if not named:
            first, null = trials, family_null(trials, rng)
        taken = {item.trial.key for item in named}
        ranked = [item for item in best_by_place(trials) if item.key not in taken]
        if not ranked or null.p_value(ranked[0].log_p) > level:
            break
        winner, rivals = _decide(problem, basis, residual, ranked)
        if _only_polish(problem, winner, named) or _too_small(problem, winner):
            break
        named.append(Named(winner, null.p_value(winner.log_p), rivals))
        columns = np.hstack([problem.columns(winner.effect, winner.place, winner.shape), tangent_columns(problem, winner)])
        basis = extend(basis, columns)
        residual = residual - basis @ (basis.T @ residual)
    return Selection(tuple(named), basis, residual, null, tuple(first))


def _only_polish(problem: Problem, winner: Trial, named: list[Named]) -> bool:
    """Whether a further effect merely mends the shape of a far stronger one on the same channels."""
    home = set(_home(problem, winner))
    return any(
        winner.gain < _POLISH * item.trial.gain and home & set(_home(problem, item.trial)) for item in named
    )


def _too_small(problem: Problem, item: Trial) -> bool:
    """Whether, without replicates, an effect is below the floor that every real recording keeps."""
    if problem.fit.replicated:
        return False
    if at_an_end(item.effect, item.shape):
        return True
    share = contribution(problem, item)
    whole = problem.whiten([block.target[:, None, :] for block in problem.blocks])[:, 0]
    rows = problem.channel_slices[carrying_channels(problem, share)[0]]
    return bool(np.linalg.norm(share[rows]) < _SIZE_FLOOR * np.linalg.norm(whole[rows]))


def _home(problem: Problem, item: Trial) -> tuple[str, ...]:
    return carrying_channels(problem, contribution(problem, item))


def _decide(
    problem: Problem, basis: FloatArray, residual: FloatArray, ranked: list[Trial]
) -> tuple[Trial, tuple[Trial, ...]]:
    """Refine the leading candidates and pick the one with the best penalised gain; the rest are rivals or losers."""
    lead = max(item.penalised for item in ranked)
    near = [item for item in ranked if item.penalised > 0.6 * lead - _CLOSE][:14]
    refined = sorted((refine(problem, basis, residual, item) for item in near), key=lambda item: -item.penalised)
    if not problem.fit.replicated:
        refined = [item for item in refined if not at_an_end(item.effect, item.shape)] or refined[:1]
    winner = refined[0]
    rivals = [
        item
        for item in refined[1:]
        if winner.penalised - item.penalised < _RIVAL_GAP or cosine(winner, item) > _RIVAL_COSINE
    ]
    return winner, tuple(rivals)


def cosine(first: Trial, second: Trial) -> float:
    """Largest cosine between the projected columns of two candidates."""
    return float(np.linalg.svd(first.basis.T @ second.basis, compute_uv=False)[0])


def rebased(problem: Problem, selection: Selection, named: list[Named]) -> Selection:
    """The selection with other effects in it: their columns and tangents join the baseline.

    Args:
        problem: the problem.
        selection: where the null and the first trials come from.
        named: the effects it is to hold.

    Returns:
        The selection with its basis and residual formed anew.
    """
    basis = problem.basis
    for item in named:
        columns = problem.columns(item.trial.effect, item.trial.place, item.trial.shape)
        basis = extend(basis, np.hstack([columns, tangent_columns(problem, item.trial)]))
    residual = problem.residual - basis @ (basis.T @ problem.residual)
    return Selection(tuple(named), basis, residual, selection.null, selection.first)


def backward(problem: Problem, selection: Selection, level: float) -> Selection:
    """Drop effects that the others make superfluous, refitting the rest jointly.

    Args:
        problem: the problem.
        selection: the forward selection.
        level: family-wise significance level.

    Returns:
        The pruned selection, with every effect refitted in the presence of the others.
    """
    named = list(selection.named)
    while named:
        refitted = [_in_presence(problem, named, k) for k in range(len(named))]
        p_values = [selection.null.p_value(item.log_p) if item else 1.0 for item in refitted]
        worst = int(np.argmax(p_values))
        if p_values[worst] <= level:
            named = [
                replace(old, trial=new, p_value=p) for old, new, p in zip(named, refitted, p_values, strict=True) if new
            ]
            break
        named.pop(worst)
    return rebased(problem, selection, named)


def _in_presence(problem: Problem, named: list[Named], index: int) -> Trial | None:
    """Refit one effect with all others in the model."""
    basis = problem.basis
    for k, other in enumerate(named):
        if k != index:
            columns = problem.columns(other.trial.effect, other.trial.place, other.trial.shape)
            basis = extend(basis, np.hstack([columns, tangent_columns(problem, other.trial)]))
    residual = problem.residual - basis @ (basis.T @ problem.residual)
    item = named[index].trial
    found = trial(problem, basis, residual, item.effect, item.place, item.shape)
    return refine(problem, basis, residual, found) if found is not None else None
