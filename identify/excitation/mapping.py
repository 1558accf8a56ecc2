"""From free numbers to a motion that keeps every joint's limits: shape, place and share of the room.

Per joint 2 h numbers give a shape; its size follows from whichever of position, velocity and acceleration
binds first. Maxima are taken by log-sum-exp (which is never below the maximum) during the search, and by
rigorous bounds for the result, so that both are feasible and the search has a gradient.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.excitation.bounds import series_bounds
from identify.excitation.limits import MotionLimits
from identify.excitation.series import FourierSeries
from identify.rotations import FloatArray

_SMOOTH_MIN = (
    12.0  # power of the smooth minimum over the three limits: 1 / 12 of ln 3 below the minimum at most
)
_ROUNDING = 1.0 - 1e-7


@dataclass(frozen=True)
class Waves:
    """Unit lines and their derivatives on a grid of one period.

    Attributes:
        q: shape (2 h, N), cosines before sines.
        qd: first derivatives, shape (2 h, N).
        qdd: second derivatives, shape (2 h, N).
    """

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray


def unit_waves(fundamental_hz: float, harmonics: int, count: int) -> Waves:
    """Evaluate unit lines on ``count`` evenly spaced instants of a period."""
    w = 2.0 * np.pi * fundamental_hz * np.arange(1, harmonics + 1)[:, None]
    phase = w / fundamental_hz * (np.arange(count) / count)
    c, s = np.cos(phase), np.sin(phase)
    return Waves(np.vstack([c, s]), np.vstack([-w * s, w * c]), np.vstack([-(w**2) * c, -(w**2) * s]))


@dataclass(frozen=True)
class ShapeMapping:
    """The mapping between x of length n (2 h + 2) and motions.

    Per joint: 2 h shape numbers, place of the motion in the room left (0 to 1), share of the size that the
    limits allow (0 to 1).

    Attributes:
        limits: what every motion keeps.
        fundamental_hz: repetition rate [Hz].
        harmonics: number of lines h.
        waves: on the information grid.
    """

    limits: MotionLimits
    fundamental_hz: float
    harmonics: int
    waves: Waves

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.limits.lower)

    @property
    def width(self) -> int:
        """Numbers per joint."""
        return 2 * self.harmonics + 2

    @property
    def box(self) -> list[tuple[float | None, float | None]]:
        """Bounds of x."""
        return ([(None, None)] * (2 * self.harmonics) + [(0.0, 1.0), (0.05, 1.0)]) * self.joints

    def random(self, rng: np.random.Generator) -> FloatArray:
        """Draw a random feasible x at full size: Gaussian lines, falling with frequency by a random power."""
        lines = np.tile(np.arange(1, self.harmonics + 1), 2)
        x = np.empty((self.joints, self.width))
        fall = rng.uniform(0.0, 1.0, (self.joints, 1))
        x[:, :-2] = rng.standard_normal((self.joints, 2 * self.harmonics)) / lines**fall
        x[:, -2], x[:, -1] = rng.uniform(0.0, 1.0, self.joints), 1.0
        return x.ravel()

    def shapes(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Split x into unit shapes (n, 2 h), places (n,) and shares (n,)."""
        table = x.reshape(self.joints, self.width)
        norms = np.linalg.norm(table[:, :-2], axis=1, keepdims=True)
        return table[:, :-2] / np.maximum(norms, 1e-12), table[:, -2], table[:, -1]

    def series(self, x: FloatArray) -> FourierSeries:
        """Give the motion of x, as large as rigorous bounds allow."""
        unit, place, share = self.shapes(x)
        h = self.harmonics
        shape = FourierSeries(self.fundamental_hz, np.zeros(self.joints), unit[:, :h], unit[:, h:])
        low, high = series_bounds(shape, 0)
        fast = np.max(np.abs(series_bounds(shape, 1)), axis=0)
        hard = np.max(np.abs(series_bounds(shape, 2)), axis=0)
        room = self.limits.upper - self.limits.lower
        size = (
            share
            * _ROUNDING
            * np.minimum(
                room / (high - low), np.minimum(self.limits.velocity / fast, self.limits.acceleration / hard)
            )
        )
        offset = self.limits.lower - size * low + place * (room - size * (high - low))
        return FourierSeries(
            self.fundamental_hz, offset, size[:, None] * shape.cosine, size[:, None] * shape.sine
        )

    def x_of(self, series: FourierSeries) -> FloatArray:
        """Invert: the x whose motion is the given one, or the nearest inside the limits (warm start)."""
        x = np.zeros((self.joints, self.width))
        h = min(self.harmonics, series.harmonics)
        x[:, :h], x[:, self.harmonics : self.harmonics + h] = series.cosine[:, :h], series.sine[:, :h]
        x[:, -1] = 1.0
        size = np.linalg.norm(x[:, :-2], axis=1)
        full = self.series(x.ravel())
        room = np.hypot(full.cosine, full.sine).max(axis=1)
        now = np.hypot(series.cosine, series.sine).max(axis=1)
        x[:, -1] = np.clip(now / np.maximum(room, 1e-12), 0.05, 1.0)
        x[size < 1e-9, 0] = 1.0
        fitted = self.series(x.ravel())
        low, high = series_bounds(fitted, 0)
        slack = (self.limits.upper - self.limits.lower) - (high - low)
        begin = self.limits.lower + fitted.offset - low  # offset of place zero
        x[:, -2] = np.clip((series.offset - begin) / np.maximum(slack, 1e-12), 0.0, 1.0)
        return x.ravel()


@dataclass(frozen=True)
class SmoothMotion:
    """The motion of x under smooth maxima, with what its gradient needs.

    Attributes:
        q: shape (n, N).
        qd: shape (n, N).
        qdd: shape (n, N).
    """

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    _mapping: ShapeMapping
    _x: FloatArray
    _parts: tuple[FloatArray, ...]

    def pull_back(self, q_bar: FloatArray, qd_bar: FloatArray, qdd_bar: FloatArray) -> FloatArray:
        """Turn derivatives by the sampled motion, each (n, N), into the gradient by x."""
        return _pull_back(self._mapping, self._x, self._parts, (q_bar, qd_bar, qdd_bar))


def _soft_max(values: FloatArray, sharpness: float) -> tuple[FloatArray, FloatArray]:
    """Log-sum-exp over the last axis relative to its root mean square, and its weights."""
    size = np.sqrt(np.mean(values**2, axis=-1, keepdims=True))
    scaled = sharpness * values / size
    top = scaled.max(axis=-1, keepdims=True)
    weights = np.exp(scaled - top)
    total = weights.sum(axis=-1, keepdims=True)
    value = (top + np.log(total)) * size / sharpness
    weights /= total
    # derivative through the size: value / size - <weights, values> / size per unit of size
    through = (value - np.sum(weights * values, axis=-1, keepdims=True)) / size
    gradient = weights + through * values / (size * values.shape[-1])
    return value[..., 0], gradient


def smooth_motion(mapping: ShapeMapping, x: FloatArray, sharpness: float) -> SmoothMotion:
    """Evaluate the motion of x on the grid, sized by smooth maxima.

    Args:
        mapping: shapes and limits.
        x: shape (n (2 h + 2),).
        sharpness: of the maxima; the motion is a little smaller than the limits allow, by ln N / sharpness.

    Returns:
        The sampled motion.
    """
    unit, place, share = mapping.shapes(x)
    waves, limits = mapping.waves, mapping.limits
    s, sd, sdd = unit @ waves.q, unit @ waves.qd, unit @ waves.qdd
    high, high_w = _soft_max(s, sharpness)
    low, low_w = _soft_max(-s, sharpness)
    fast, fast_w = _soft_max(np.concatenate([sd, -sd], axis=1), sharpness)
    hard, hard_w = _soft_max(np.concatenate([sdd, -sdd], axis=1), sharpness)
    room = limits.upper - limits.lower
    needs = np.stack([(high + low) / room, fast / limits.velocity, hard / limits.acceleration])  # 1 / size
    total = np.sum(needs**_SMOOTH_MIN, axis=0) ** (1.0 / _SMOOTH_MIN)
    size = share / total
    offset = limits.lower + size * low + place * (room - size * (high + low))
    parts = (unit, place, share, s, sd, sdd, high, low, high_w, low_w, fast_w, hard_w, needs, total, size)
    return SmoothMotion(
        offset[:, None] + size[:, None] * s, size[:, None] * sd, size[:, None] * sdd, mapping, x, parts
    )


def _pull_back(
    mapping: ShapeMapping,
    x: FloatArray,
    parts: tuple[FloatArray, ...],
    bars: tuple[FloatArray, FloatArray, FloatArray],
) -> FloatArray:
    unit, place, share, s, sd, sdd, high, low, high_w, low_w, fast_w, hard_w, needs, total, size = parts
    q_bar, qd_bar, qdd_bar = bars
    waves, limits = mapping.waves, mapping.limits
    room, count = limits.upper - limits.lower, s.shape[1]
    offset_bar = q_bar.sum(axis=1)
    size_bar = np.sum(q_bar * s + qd_bar * sd + qdd_bar * sdd, axis=1)
    size_bar += offset_bar * (low - place * (high + low))
    place_bar = offset_bar * (room - size * (high + low))
    low_bar = offset_bar * size * (1.0 - place)
    high_bar = -offset_bar * size * place
    share_bar = size_bar / total
    total_bar = -size_bar * share / total**2
    needs_bar = total_bar * (needs / total) ** (_SMOOTH_MIN - 1.0)
    low_bar, high_bar = low_bar + needs_bar[0] / room, high_bar + needs_bar[0] / room
    fast_bar, hard_bar = needs_bar[1] / limits.velocity, needs_bar[2] / limits.acceleration
    s_bar = size[:, None] * q_bar + high_bar[:, None] * high_w - low_bar[:, None] * low_w
    sd_bar = size[:, None] * qd_bar + fast_bar[:, None] * (fast_w[:, :count] - fast_w[:, count:])
    sdd_bar = size[:, None] * qdd_bar + hard_bar[:, None] * (hard_w[:, :count] - hard_w[:, count:])
    unit_bar = s_bar @ waves.q.T + sd_bar @ waves.qd.T + sdd_bar @ waves.qdd.T
    raw = x.reshape(mapping.joints, mapping.width)[:, :-2]
    norms = np.maximum(np.linalg.norm(raw, axis=1, keepdims=True), 1e-12)
    raw_bar = (unit_bar - unit * np.sum(unit * unit_bar, axis=1, keepdims=True)) / norms
    return np.concatenate([raw_bar, place_bar[:, None], share_bar[:, None]], axis=1).ravel()
