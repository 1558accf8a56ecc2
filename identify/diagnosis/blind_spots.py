"""What these data could not have shown: the smallest size of every effect that would have stood out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from identify.diagnosis.candidates import Trial
from identify.diagnosis.null import FamilyNull
from identify.diagnosis.problem import Problem
from identify.physics.effect import Effect

_POWER = 0.9
_CONFUSED = 0.9  # cosine from which two effects look alike in these data
_MOST_RIVALS = 4


@dataclass(frozen=True)
class BlindSpot:
    """Detectability of one effect.

    Attributes:
        effect: its name.
        smallest_detectable: size that would be found with 90 % power, at its best place; None where the
            model swallows the effect whole.
        unit: of that size.
        place: where that is, in words.
        by_place: the size at every place.
        swallowed: share of the effect that the baseline absorbs at the best place.
        confused_with: effects that look like it in these data.
        reason: why there is no size, empty where there is one.
    """

    effect: str
    smallest_detectable: float | None
    unit: str
    place: str
    by_place: dict[str, float]
    swallowed: float | None
    confused_with: tuple[str, ...]
    reason: str = ""


def place_name(problem: Problem, trial_place) -> str:  # noqa: ANN001
    """Name a place: its joint, its channel, or the robot."""
    if trial_place.joint is not None:
        name = problem.scene.robot.joints[trial_place.joint].name
        if trial_place.partner is not None:
            name += "+" + problem.scene.robot.joints[trial_place.partner].name
        return name
    return trial_place.channel or "robot"


def _smallest(item: Trial, level: float) -> float:
    """Smallest first coefficient: (z_alpha + z_power) / |MX|, along the effect's own direction."""
    z = stats.norm.isf(level / 2.0) + stats.norm.isf(1.0 - _POWER)
    covariance = np.linalg.inv(item.triangle)
    stds = np.sqrt(np.sum(covariance**2, axis=1))
    return float(z * stds[0])


def _sizes(problem: Problem, trials: list[Trial], level: float) -> dict[str, tuple[float, Trial]]:
    result: dict[str, tuple[float, Trial]] = {}
    for item in trials:
        if 0 not in item.kept:
            continue
        where = place_name(problem, item.place)
        size = _smallest(item, level)
        if where not in result or size < result[where][0]:
            result[where] = (size, item)
    return result


def blind_spots(problem: Problem, effects: list[Effect], trials: tuple[Trial, ...], null: FamilyNull, level: float) -> list[BlindSpot]:
    """Tabulate the smallest detectable size of every effect of the catalogue.

    Args:
        problem: the problem.
        effects: the catalogue.
        trials: all trials on the baseline.
        null: the family's null distribution; the single-test level follows from it.
        level: family-wise level.

    Returns:
        One entry an effect.

    Source:
        Noncentrality beta^2 |MX|^2; smallest detectable (z_alpha + z_power) / |MX|; swallowed share 1 - |MX|^2 / |X|^2.
    """
    single = level / null.effective
    best: dict[str, dict[str, tuple[float, Trial]]] = {
        effect.name: _sizes(problem, [t for t in trials if t.effect.name == effect.name], single) for effect in effects
    }

    result = []
    for effect in effects:
        sizes = best[effect.name]
        if not sizes:
            result.append(BlindSpot(effect.name, None, effect.unit, "", {}, None, (), _why_unseen(problem, effect)))
            continue
        where, (size, item) = min(sizes.items(), key=lambda pair: pair[1][0])
        own = np.linalg.norm(item.triangle[:, 0]) / max(item.norms[0], 1e-300)
        result.append(
            BlindSpot(
                effect.name, size, effect.unit, where, {key: value[0] for key, value in sizes.items()},
                float(np.clip(1.0 - own**2, 0.0, 1.0)), _rivals(item, trials),
            )
        )
    return result


def _rivals(item: Trial, trials: tuple[Trial, ...]) -> tuple[str, ...]:
    """Effects whose best-matching candidate at the same place looks alike."""
    scores: dict[str, float] = {}
    for other in trials:
        if other.effect.name == item.effect.name or (other.place.joint is not None and other.place.joint != item.place.joint):
            continue
        value = float(np.linalg.svd(item.basis.T @ other.basis, compute_uv=False)[0])
        scores[other.effect.name] = max(scores.get(other.effect.name, 0.0), value)
    ranked = sorted((name for name, value in scores.items() if value > _CONFUSED), key=lambda name: -scores[name])
    return tuple(ranked[:_MOST_RIVALS])


def _why_unseen(problem: Problem, effect: Effect) -> str:
    if effect.progressive:
        return "tested on the differences between the periods, not on their mean"
    if not effect.places(problem.scene):
        return "this robot, or what was recorded of it, has no place for it"
    return "the model's own parameters absorb it whole, so no such recording can show it"
