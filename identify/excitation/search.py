"""Multi-start search: many random starts, a few refined, the best kept whenever it is stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from identify.excitation.feasibility import torque_violation, workspace_violation
from identify.excitation.objective import Problem
from identify.excitation.series import FourierSeries
from identify.rotations import FloatArray

_DRAWS = 24  # random motions a start: the best of them is optimised
# sharpness of the smooth maxima, stiffness of the penalties and iterations, stage by stage
_EXPLORE = ((25.0, 10.0, 30),)
_REFINE = ((50.0, 100.0, 60), (400.0, 1e4, 60))
_SHRINK_STEPS = 30
_LEAST_SIZE = 0.02  # share of the size below which a constraint counts as unreachable


@dataclass(frozen=True)
class Progress:
    """How far the search is.

    Attributes:
        done: tasks finished.
        total: tasks in all.
        best: best criterion so far (lower is better); inf before the first.
    """

    done: int
    total: int
    best: float


@dataclass(frozen=True)
class Candidate:
    """A motion with its value.

    Attributes:
        value: criterion on the finished, feasible motion; inf where no size of it is feasible.
        x: free numbers.
        series: the motion.
        evaluations: of objective and gradient.
        interrupted: whether the operator stopped it.
    """

    value: float
    x: FloatArray
    series: FourierSeries
    evaluations: int
    interrupted: bool = False


@dataclass(frozen=True)
class Outcome:
    """What the search found.

    Attributes:
        best: the best candidate.
        evaluations: in all.
        interrupted: whether the operator stopped it before its end.
    """

    best: Candidate
    evaluations: int
    interrupted: bool


def feasible_series(problem: Problem, series: FourierSeries) -> FourierSeries | None:
    """Draw a motion towards a safe pose until torques and distances keep their limits; None if none does."""

    def fits(size: float, pose: FloatArray) -> bool:
        drawn = series.shrunk(size, pose)
        return not (
            torque_violation(problem.information, problem.mapping.limits, drawn)
            or workspace_violation(problem.information.model.robot, problem.workspace, drawn)
        )

    own, home = series.offset, np.clip(0.0, problem.mapping.limits.lower, problem.mapping.limits.upper)
    if fits(1.0, own):
        return series
    for pose in (own, home, problem.mapping.limits.middle):
        if not fits(_LEAST_SIZE, pose):
            continue
        low, high = _LEAST_SIZE, 1.0
        for _ in range(_SHRINK_STEPS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if fits(middle, pose) else (low, middle)
            if high - low < 1e-3:
                break
        return series.shrunk(low, pose)
    return None


def finish(problem: Problem, x: FloatArray, evaluations: int = 0, interrupted: bool = False) -> Candidate:
    """Turn free numbers into a feasible motion and judge it."""
    series = problem.mapping.series(x)
    feasible = feasible_series(problem, series)
    if feasible is None:
        return Candidate(float("inf"), x, series, evaluations, interrupted)
    return Candidate(problem.value_of(feasible), x, feasible, evaluations, interrupted)


def _stage(
    problem: Problem, x: FloatArray, sharpness: float, stiffness: float, iterations: int
) -> tuple[FloatArray, int, bool]:
    """Minimise once; also the number of evaluations and whether the operator stopped it."""
    best: list = [np.inf, x]
    count = [0]

    def objective(z: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = problem.value_and_gradient(z, sharpness, stiffness)
        count[0] += 1
        if not np.isfinite(value):
            return 1e30, np.zeros_like(z)
        if value < best[0]:
            best[:] = value, z.copy()
        return value, gradient

    try:
        minimize(
            objective,
            x,
            jac=True,
            method="L-BFGS-B",
            bounds=problem.mapping.box,
            options={"maxiter": iterations, "maxfun": 2 * iterations, "maxcor": 20, "ftol": 1e-9},
        )
    except KeyboardInterrupt:
        return best[1], count[0], True
    return best[1], count[0], False


def _normalised(problem: Problem, x: FloatArray) -> FloatArray:
    """Rescale the shapes to unit norm, on which the motion does not depend and the search's steps do."""
    table = x.reshape(problem.mapping.joints, -1).copy()
    table[:, :-2] /= np.maximum(np.linalg.norm(table[:, :-2], axis=1, keepdims=True), 1e-12)
    return table.ravel()


def _run(problem: Problem, x: FloatArray, stages: Iterable[tuple[float, float, int]]) -> Candidate:
    evaluations, stopped = 0, False
    for sharpness, stiffness, iterations in stages:
        x, count, stopped = _stage(problem, _normalised(problem, x), sharpness, stiffness, iterations)
        evaluations += count
        if stopped:
            break
    return finish(problem, x, evaluations, stopped)


def _best_draw(problem: Problem, seed: int, start: int, sharpness: float) -> FloatArray:
    rng = np.random.default_rng([seed, start])
    draws = [problem.mapping.random(rng) for _ in range(_DRAWS)]
    return min(draws, key=lambda x: problem.quick_value(x, sharpness))


def explore(problem: Problem, seed: int, start: int, given: FloatArray | None = None) -> Candidate:
    """Optimise one start roughly: the best of some random motions, or a given one."""
    sharpness = _EXPLORE[0][0]
    if given is None:
        given = _best_draw(problem, seed, start, sharpness)
    return _run(problem, given, _EXPLORE)


def refine(problem: Problem, x: FloatArray) -> Candidate:
    """Optimise a good candidate to the end."""
    return _run(problem, x, _REFINE)


def _each(executor: Executor | None, tasks: list[tuple]) -> Iterator[tuple[int, Candidate]]:
    """Run tasks here or on an executor; yields (index, result) as they finish."""
    if executor is None:
        for index, (function, *arguments) in enumerate(tasks):
            yield index, function(*arguments)
        return
    futures = {executor.submit(*task): index for index, task in enumerate(tasks)}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()


def search(
    problem: Problem,
    seed: int,
    starts: int,
    refined: int,
    executor: Executor | None = None,
    progress: Callable[[Progress], None] | None = None,
    warm: FourierSeries | None = None,
) -> Outcome:
    """Search for the best motion.

    Args:
        problem: criterion and constraints.
        seed: of the random starts; the same seed gives the same motion, however the work is spread.
        starts: number of random starts.
        refined: number of them that are optimised to the end.
        executor: spreads the starts; None works here.
        progress: told after every task.
        warm: a motion to start from besides.

    Returns:
        The best found; on an interruption the best so far.
    """
    found: dict[int, Candidate] = {}
    total = starts + (warm is not None) + refined
    tasks: list[tuple] = [(explore, problem, seed, start) for start in range(starts)]
    if warm is not None:
        tasks.append((explore, problem, seed, starts, problem.mapping.x_of(warm)))
    interrupted = _collect(found, 0, tasks, total, executor, progress)
    if not interrupted:
        order = sorted(found, key=lambda index: (found[index].value, index))
        finals: list[tuple] = [(refine, problem, found[index].x) for index in order[:refined]]
        interrupted = _collect(found, len(tasks), finals, total, executor, progress)
    if not found:  # stopped before the first start was done
        found[0] = finish(problem, _best_draw(problem, seed, 0, _EXPLORE[0][0]))
    best = min(found.items(), key=lambda item: (item[1].value, item[0]))[1]
    return Outcome(best, sum(candidate.evaluations for candidate in found.values()), interrupted)


def _collect(
    found: dict[int, Candidate],
    first: int,
    tasks: list[tuple],
    total: int,
    executor: Executor | None,
    progress: Callable[[Progress], None] | None,
) -> bool:
    """Gather results; True when the operator stopped it."""
    try:
        for index, candidate in _each(executor, tasks):
            found[first + index] = candidate
            if progress is not None:
                progress(Progress(len(found), total, min(c.value for c in found.values())))
            if candidate.interrupted:
                return True
    except KeyboardInterrupt:
        return True
    return False
