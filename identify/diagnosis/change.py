"""What has changed since an earlier calibration: the difference of two estimates, explained by named causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from identify.diagnosis.hypotheses import Hypothesis
from identify.model import Model
from identify.rotations import FloatArray

LEVEL_CHANGE = 0.002  # family-wise: the chance to name a change where there is none
_MOST = 4
_RIVAL_GAP = 6.0  # BIC difference below which the data do not decide
_SEEN = 1e-10  # of the largest eigenvalue of the correlation: below it two estimates say nothing of a direction


@dataclass(frozen=True)
class State:
    """An estimate as a vector: parameters, then torque constants.

    Attributes:
        values: nan where not identifiable, shape (P + n,).
        covariance: likewise, shape (P + n, P + n).
    """

    values: FloatArray
    covariance: FloatArray


@dataclass(frozen=True)
class Difference:
    """Two estimates' difference, whitened by their joint covariance.

    Attributes:
        used: which entries both know, shape (k,).
        values: now less reference, shape (k,).
        covariance: of that, shape (k, k).
        root: whitening matrix, shape (r, k).
    """

    used: FloatArray
    values: FloatArray
    covariance: FloatArray
    root: FloatArray

    @property
    def whitened(self) -> FloatArray:
        """Shape (r,), standard normal where nothing has changed."""
        return self.root @ self.values

    def columns(self, directions: FloatArray) -> FloatArray:
        """Whiten directions (P + n, m)."""
        return self.root @ directions[self.used]


@dataclass(frozen=True)
class NamedChange:
    """A change with a cause.

    Attributes:
        hypothesis: the cause.
        values: its coefficients, nan where the estimates do not fix them, shape (m,).
        covariance: of those, nan likewise, shape (m, m).
        gain: what chi-square loses without it.
        width: its degrees of freedom.
        p_value: corrected for all causes tried.
        rivals: other causes that explain the change as well.
    """

    hypothesis: Hypothesis
    values: FloatArray
    covariance: FloatArray
    gain: float
    width: int
    p_value: float
    rivals: tuple[Hypothesis, ...]


@dataclass(frozen=True)
class Comparison:
    """Two estimates compared.

    Attributes:
        difference: their difference.
        p_value: chance that nothing has changed (Wald test of all parameters).
        changes: named causes.
        rest_p: chance of what the causes leave.
        groups: Wald tests of the physical groups, corrected by Holm, by name.
    """

    difference: Difference
    p_value: float
    changes: tuple[NamedChange, ...]
    rest_p: float
    groups: dict[str, float]


def difference_of(model: Model, now: State, reference: State) -> Difference:
    """Subtract two estimates on what both know; plate offsets are left out, every run has its own.

    Args:
        model: of both.
        now: the new estimate.
        reference: the earlier one.

    Returns:
        The difference.
    """
    plate = np.array([p.group == "plate" for p in model.parameters] + [False] * model.robot.n)
    known = np.isfinite(now.values) & np.isfinite(reference.values) & ~plate
    for state in (now, reference):
        known &= np.isfinite(np.diag(state.covariance))
    used = np.flatnonzero(known)
    grid = np.ix_(used, used)
    covariance = now.covariance[grid] + reference.covariance[grid]
    size = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    seen = values > _SEEN * values[-1]
    root = (vectors[:, seen] / np.sqrt(values[seen])).T / size
    return Difference(used, now.values[used] - reference.values[used], covariance, root)


def compare(
    model: Model, now: State, reference: State, hypotheses: Sequence[Hypothesis], rows: int, level: float = LEVEL_CHANGE
) -> Comparison:
    """Explain the difference of two estimates by as few causes as needed.

    Args:
        model: of both.
        now: the new estimate.
        reference: the earlier one.
        hypotheses: causes to try.
        rows: observations behind the new estimate (price of a parameter by BIC).
        level: family-wise level.

    Returns:
        The comparison.

    Source:
        Wald tests on the difference of independent estimates; forward selection with Holm's correction.
    """
    difference = difference_of(model, now, reference)
    target = difference.whitened
    price, count = float(np.log(max(rows, 2))), max(len(hypotheses), 1)
    columns = [difference.columns(item.directions) for item in hypotheses]
    chosen: list[int] = []
    rivals: dict[int, tuple[int, ...]] = {}
    while len(chosen) < min(_MOST, count):
        scored = _scores(target, columns, chosen, price)
        fit = {k: s for k, s in scored.items() if count * stats.chi2.sf(s[0], s[1]) < level and s[2] > 0.0}
        if not fit:
            break
        best = max(fit, key=lambda k: fit[k][2])
        chosen.append(best)
        rivals[best] = tuple(k for k, s in fit.items() if k != best and fit[best][2] - s[2] < _RIVAL_GAP)
    chosen = _backward(target, columns, chosen, count, level)
    changes = tuple(_named(target, columns, hypotheses, chosen, k, rivals[k], count) for k in chosen)
    rest = _rest(target, [columns[k] for k in chosen])
    rank = sum(change.width for change in changes)
    omnibus = float(stats.chi2.sf(target @ target, max(len(target), 1)))
    rest_p = float(stats.chi2.sf(rest @ rest, max(len(target) - rank, 1)))
    return Comparison(difference, omnibus, changes, rest_p, _groups(model, difference))


def _basis(parts: Sequence[FloatArray], rows: int) -> FloatArray:
    """Orthonormal basis of columns of very different units."""
    if not parts:
        return np.zeros((rows, 0))
    stacked = np.hstack(parts)
    norms = np.linalg.norm(stacked, axis=0)
    stacked = stacked[:, norms > 0] / norms[norms > 0]
    if stacked.shape[1] == 0:
        return np.zeros((rows, 0))
    left, values, _ = np.linalg.svd(stacked, full_matrices=False)
    return left[:, values > 1e-7 * values[0]]


def _rest(target: FloatArray, parts: Sequence[FloatArray]) -> FloatArray:
    basis = _basis(parts, len(target))
    return target - basis @ (basis.T @ target)


def _gain(target: FloatArray, others: Sequence[FloatArray], own: FloatArray) -> tuple[float, int]:
    """Drop in chi-square and degrees of freedom that a cause adds to others."""
    without, joint = _basis(others, len(target)), _basis([*others, own], len(target))
    drop = float(np.sum((joint.T @ target) ** 2) - np.sum((without.T @ target) ** 2))
    return max(drop, 0.0), joint.shape[1] - without.shape[1]


def _scores(
    target: FloatArray, columns: Sequence[FloatArray], chosen: list[int], price: float
) -> dict[int, tuple[float, int, float]]:
    """Gain, width and gain less the price of the parameters, for every cause not chosen yet."""
    others = [columns[k] for k in chosen]
    result = {}
    for k, own in enumerate(columns):
        if k in chosen:
            continue
        gain, width = _gain(target, others, own)
        if width:
            result[k] = (gain, width, gain - width * price)
    return result


def _backward(
    target: FloatArray, columns: Sequence[FloatArray], chosen: list[int], count: int, level: float
) -> list[int]:
    """Drop causes that the others have made superfluous."""
    for k in list(chosen):
        gain, width = _gain(target, [columns[j] for j in chosen if j != k], columns[k])
        if not width or count * stats.chi2.sf(gain, width) >= level:
            chosen = [j for j in chosen if j != k]
    return chosen


def _named(
    target: FloatArray, columns: Sequence[FloatArray], hypotheses: Sequence[Hypothesis], chosen: list[int], k: int,
    rivals: tuple[int, ...], count: int,
) -> NamedChange:
    others = [columns[j] for j in chosen if j != k]
    gain, width = _gain(target, others, columns[k])
    values, covariance = _coefficients(target, others, columns[k])
    p = float(min(1.0, count * stats.chi2.sf(gain, max(width, 1))))
    return NamedChange(
        hypotheses[k], values, covariance, gain, width, max(p, 1e-300), tuple(hypotheses[j] for j in rivals if j not in chosen)
    )


def _coefficients(target: FloatArray, others: Sequence[FloatArray], own: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients of a cause beside others and their covariance; nan where the estimates do not fix them."""
    basis = _basis(others, len(target))
    free, rest = own - basis @ (basis.T @ own), target - basis @ (basis.T @ target)
    norms = np.linalg.norm(free, axis=0)
    safe = np.where(norms > 0, norms, 1.0)
    left, values, right = np.linalg.svd(free / safe, full_matrices=False)
    seen = values > 1e-7 * values.max(initial=1e-300)
    root = right[seen].T / values[seen] / safe[:, None]
    solution, covariance = root @ (left[:, seen].T @ rest), root @ root.T
    lost = (np.linalg.norm(right[~seen], axis=0) > 1e-5) | (norms == 0)
    solution[lost] = np.nan
    covariance[lost, :] = np.nan
    covariance[:, lost] = np.nan
    return solution, covariance


def _groups(model: Model, difference: Difference) -> dict[str, float]:
    """Wald test of every physical group, corrected by Holm."""
    names: dict[str, list[int]] = {}
    count = len(model.parameters)
    for position, index in enumerate(difference.used):
        if index >= count:
            name = f"torque_constant:{model.robot.joint_names[index - count]}"
        else:
            parameter = model.parameters[index]
            name = parameter.group + (f":{parameter.joint}" if parameter.joint else "")
        names.setdefault(name, []).append(position)
    raw = {name: _wald(difference, rows) for name, rows in names.items()}
    result, worst = {}, 0.0
    for rank, (name, p) in enumerate(sorted(raw.items(), key=lambda item: item[1])):
        worst = max(worst, min(1.0, p * (len(raw) - rank)))
        result[name] = worst
    return result


def _wald(difference: Difference, rows: list[int]) -> float:
    d, c = difference.values[rows], difference.covariance[np.ix_(rows, rows)]
    size = np.sqrt(np.diag(c))
    values, vectors = np.linalg.eigh(c / np.outer(size, size))
    seen = values > _SEEN * values[-1]
    whitened = (vectors[:, seen].T @ (d / size)) / np.sqrt(values[seen])
    return float(stats.chi2.sf(whitened @ whitened, int(seen.sum())))
