"""What changes from period to period: drift, warm-up, and tones that are no harmonics of the period."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import stats

from identify.diagnosis.describe import carrying_channels
from identify.diagnosis.problem import Problem
from identify.physics.effect import Effect, Place
from identify.rotations import FloatArray

# courses in time tried for what changes: a ramp, and approaches to a steady state with these time constants [runs]
_TIME_CONSTANTS = (0.1, 0.3)
_MOST = 3  # effects that change over one run
_RIVAL_GAP = 6.0  # BIC difference below which the data do not decide
_PRICE = 9.0  # of a parameter: the logarithm of the number of rows
# time constants tried for what an effect lets die out after the start [runs]
_SETTLING = (0.05, 0.1, 0.2, 0.4, 0.8, 2.0)


@dataclass(frozen=True)
class Progress:
    """A progressive effect fitted to the differences between the periods.

    Attributes:
        effect: the effect.
        place: where.
        course: ``ramp`` or ``settling``.
        time_constant_s: of a settling course, None for a ramp.
        values: change of its coefficients over the run (ramp: per second), shape (k,).
        std: of the values, shape (k,).
        gain: drop in chi-square.
        width: degrees of freedom.
        p_value: corrected for all progressive tests.
    """

    effect: Effect
    place: Place
    course: str
    time_constant_s: float | None
    values: FloatArray
    std: FloatArray
    gain: float
    width: int
    p_value: float


    def raw(self, problem: Problem) -> list[FloatArray]:
        """What changes, on every block before whitening, each (c, k, B)."""
        if self.effect.settling is not None:
            return [problem.enter(k, self.effect.settling(scene, self.place)) for k, scene in enumerate(problem.scenes)]
        return problem.raw_columns(self.effect, self.place, _middle(self.effect))

    def channels(self, problem: Problem) -> tuple[str, ...]:
        """Channels that carry the change, strongest first."""
        return carrying_channels(problem, problem.whiten(self.raw(problem)) @ self.values)

    def reach(self, problem: Problem) -> set[str]:
        """Channels that the change may concern: all that its columns touch where it dies out, else those that carry it."""
        if self.effect.settling is None:
            return set(self.channels(problem))
        raw = self.raw(problem)
        return {
            channel
            for block, part in zip(problem.blocks, raw, strict=True)
            for channel, columns in zip(block.channels, part, strict=True)
            if columns.any()
        }

    def mean_columns(self, problem: Problem) -> FloatArray:
        """What the change leaves in the mean over the periods: within a period it moves on, whitened (rows, k)."""
        shaped = [
            part * block.grid_s / block.grid_s[-1] for part, block in zip(self.raw(problem), problem.blocks, strict=True)
        ]
        return problem.whiten(shaped)


@dataclass(frozen=True)
class ForeignTone:
    """A line in a channel that is no harmonic of the period.

    Attributes:
        channel: where.
        frequency_hz: its frequency.
        amplitude: [N.m or N].
        p_value: corrected for all lines of all channels.
    """

    channel: str
    frequency_hz: float
    amplitude: float
    p_value: float


def _whitened_tables(problem: Problem) -> list[FloatArray]:
    """Scatter whitened as one contiguous stretch, every block (c, M, B)."""
    result = []
    for (table, _), noise in zip(problem.fit.tables, problem.fit.noises, strict=True):
        channels, periods, count = table.shape
        result.append(noise.whiten(table.reshape(channels, periods * count)).reshape(channels, periods, count))
    return result


def _courses(times: FloatArray) -> list[tuple[str, float | None, FloatArray]]:
    """Courses over the run, each (M, B), less their mean over the periods."""
    span = times.max()
    result: list[tuple[str, float | None, FloatArray]] = [("ramp", None, times)]
    for share in _TIME_CONSTANTS:
        result.append(("settling", share * span, np.exp(-times / (share * span))))
    return [(name, tau, g - g.mean(axis=0, keepdims=True)) for name, tau, g in result]


def _fit_course(
    problem: Problem, tables: list[FloatArray], raw: list[FloatArray], course_of: list[FloatArray]
) -> tuple[FloatArray, FloatArray, float, int]:
    """Least squares of changing columns on the whitened scatter: values, std, gain, width."""
    width = raw[0].shape[1]
    normal, right = np.zeros((width, width)), np.zeros(width)
    for block, noise, table, columns, course in zip(problem.blocks, problem.fit.noises, tables, raw, course_of, strict=True):
        masked = columns * block.usable[:, None, :]
        stretched = (masked[:, :, None, :] * course[None, None]).reshape(*masked.shape[:2], -1)
        flat = noise.whiten(stretched).transpose(0, 2, 1).reshape(-1, width)
        normal += flat.T @ flat
        right += flat.T @ table.ravel()
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    seen = values > 1e-9
    root = (vectors[:, seen] / np.sqrt(values[seen])) / size[:, None]
    toward = root.T @ right
    return root @ toward, np.sqrt(np.sum(root**2, axis=1)), float(toward @ toward), int(seen.sum())


def progressive_tests(problem: Problem, effects: list[Effect]) -> list[Progress]:
    """Test every progressive effect at every place and course.

    Args:
        problem: the problem; without replicates there is nothing to test.
        effects: the catalogue.

    Returns:
        All tests, most significant first, probabilities corrected for their number.
    """
    window = problem.fit.window
    if window is None or window.periods < 3 or not problem.fit.tables:
        return []
    tables = _whitened_tables(problem)
    courses = [
        _courses(np.arange(window.periods)[:, None] * window.period_s + block.grid_s[None, :]) for block in problem.blocks
    ]
    found: list[Progress] = []
    for effect in (item for item in effects if item.progressive):
        for place in effect.places(problem.scene):
            raw = problem.raw_columns(effect, place, _middle(effect))
            for index, (name, tau, _) in enumerate(courses[0]):
                fitted = _fit_course(problem, tables, raw, [block_courses[index][2] for block_courses in courses])
                found.append(_physical(problem, effect, place, name, tau, *fitted))
    found += _settling_tests(problem, tables, effects)
    count = len(found)
    corrected = [_with_p(item, min(1.0, count * float(stats.chi2.sf(item.gain, max(item.width, 1))))) for item in found]
    return sorted(corrected, key=lambda item: (item.p_value, -item.gain))


def _settling_tests(problem: Problem, tables: list[FloatArray], effects: list[Effect]) -> list[Progress]:
    """Test what effects let die out after the run's start, over time constants."""
    window, found = problem.fit.window, []
    assert window is not None
    times = [np.arange(window.periods)[:, None] * window.period_s + b.grid_s[None, :] for b in problem.blocks]
    span = window.periods * window.period_s
    for effect in (item for item in effects if item.settling is not None):
        for place in effect.places(problem.scene):
            raw = [problem.enter(k, effect.settling(scene, place)) for k, scene in enumerate(problem.scenes)]
            for share in _SETTLING:
                courses = [np.exp(-t / (share * span)) for t in times]
                courses = [g - g.mean(axis=0, keepdims=True) for g in courses]
                values, std, gain, width = _fit_course(problem, tables, raw, courses)
                found.append(Progress(effect, place, "settling", share * span, values, std, gain, width, 1.0))
    return found


def _middle(effect: Effect) -> Mapping[str, float]:
    return {shape.name: shape.grid[len(shape.grid) // 2] for shape in effect.shapes}


def _with_p(item: Progress, p_value: float) -> Progress:
    return Progress(item.effect, item.place, item.course, item.time_constant_s, item.values, item.std, item.gain, item.width, p_value)


def _physical(
    problem: Problem,
    effect: Effect,
    place: Place,
    course: str,
    tau: float | None,
    values: FloatArray,
    std: FloatArray,
    gain: float,
    width: int,
) -> Progress:
    """Zero the gain where the change goes the wrong way (a settling course falls, a ramp rises)."""
    rising = values if course == "ramp" else -values
    if not effect.allowed(problem.scene, place, rising, _middle(effect)):
        gain = 0.0
    return Progress(effect, place, course, tau, values, std, gain, width, 1.0)


def foreign_tones(problem: Problem) -> list[ForeignTone]:
    """Look for lines between the harmonics of the period.

    Args:
        problem: the problem.

    Returns:
        Tones significant at 0.1 %, strongest first.
    """
    window = problem.fit.window
    if window is None or window.periods < 2 or not problem.fit.tables:
        return []
    found: list[ForeignTone] = []
    channels = sum(len(block.channels) for block in problem.blocks)
    for block, noise, (table, _) in zip(problem.blocks, problem.fit.noises, problem.fit.tables, strict=True):
        count = table.shape[1] * table.shape[2]
        series = table.reshape(table.shape[0], count)
        lines = np.arange(count // 2 + 1)
        foreign = (lines % window.periods != 0) & (lines > window.periods)
        white = noise.whiten(series)
        power = np.abs(np.fft.rfft(white, axis=1)) ** 2 / count
        # the scatter has lost the mean over the periods; off the harmonics nothing of a tone is lost
        for k, channel in enumerate(block.channels):
            level = np.where(foreign, power[k], 0.0)
            line = int(np.argmax(level))
            p = min(1.0, channels * float(foreign.sum()) * float(np.exp(-level[line])))
            if p < 1e-3:
                amplitude = 2.0 * np.abs(np.fft.rfft(series[k])[line]) / count
                found.append(ForeignTone(channel, line / (window.periods * window.period_s), float(amplitude), p))
    return sorted(found, key=lambda tone: tone.p_value)


def pick_progress(problem: Problem, effects: list[Effect], level: float) -> list[tuple[Progress, tuple[str, ...]]]:
    """Pick the progressive effects that stand out, no two on a common channel, with those that look alike.

    Args:
        problem: the problem.
        effects: the catalogue.
        level: level of the whole family of progressive tests.

    Returns:
        At most three effects, each with the names of its rivals.
    """
    tests = [item for item in progressive_tests(problem, effects) if item.p_value <= level and item.gain > _PRICE * (item.width + 1)]
    home = {id(item): item.reach(problem) for item in tests}
    result: list[tuple[Progress, tuple[str, ...]]] = []
    while tests and len(result) < _MOST:
        best = max(tests, key=lambda item: item.gain - _PRICE * item.width)
        same = [t for t in tests if t is not best and home[id(t)] & home[id(best)]]
        near = [
            t.effect.name
            for t in same
            if t.effect.name != best.effect.name and t.gain > best.gain - _RIVAL_GAP - _PRICE * (best.width - t.width)
        ]
        result.append((best, tuple(dict.fromkeys(near))[:4]))
        tests = [t for t in tests if t is not best and t not in same]
    return result
