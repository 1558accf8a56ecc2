"""What a model with its effects says the sensors would have shown along a recorded motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import interpolate, ndimage

from identify.dataset import Dataset
from identify.errors import NotPeriodicError
from identify.filters import AntiAliasFilter
from identify.fourier import fit_trajectory, unfiltered
from identify.friction import drive_velocity
from identify.model import Model
from identify.period import find_window
from identify.physics.effect import Effect, Place
from identify.physics.scene import Scene
from identify.rotations import FloatArray
from identify.smoothing import SmoothMotion, smooth

_CHUNK = 4096  # samples a pass: rows of all parameters fit the memory
_STANDING = 3.0  # std of the speed within which a drive may be standing
_STANDS_S = 0.25  # and so long it must stay there; a mere reversal keeps its step of friction


@dataclass(frozen=True)
class Course:
    """How an effect grows over a run.

    Attributes:
        kind: ``ramp`` (coefficients per second), ``settling``, or ``dying_out`` (what the effect lets die out
            after the start, in its own columns).
        time_constant_s: of a course that is no ramp.
        start_s: start of the run it was found in, after the first joint sample.
        span_s: length of that run.
    """

    kind: str
    time_constant_s: float | None
    start_s: float
    span_s: float

    def at(self, t_s: FloatArray) -> FloatArray:
        """Factor on the effect's columns, of zero mean over the run it was found in, shape (B,)."""
        t = t_s - self.start_s
        if self.kind == "ramp":
            return t - 0.5 * self.span_s
        tau = self.time_constant_s or self.span_s
        return np.exp(-np.maximum(t, 0.0) / tau) - tau / self.span_s * (1.0 - np.exp(-self.span_s / tau))


@dataclass(frozen=True)
class AppliedEffect:
    """An effect with its numbers.

    Attributes:
        effect: the effect.
        place: where.
        values: its coefficients, shape (k,).
        shape: its nonlinear parameters.
        course: how it grows over the run, None where it stays.
    """

    effect: Effect
    place: Place
    values: FloatArray
    shape: Mapping[str, float]
    course: Course | None = None


@dataclass(frozen=True)
class FullModel:
    """A model with numbers: rigid bodies, drives, plate, and what was found beyond them.

    Attributes:
        model: the linear model.
        theta: its parameters, 0 where not identifiable, shape (P,).
        scale: K_nominal / K of every joint, shape (n,).
        effects: what is added to it.
    """

    model: Model
    theta: FloatArray
    scale: FloatArray
    effects: tuple[AppliedEffect, ...] = ()


@dataclass(frozen=True)
class Simulated:
    """Sensors along a motion, without noise.

    Attributes:
        motion: positions, speeds and accelerations used.
        periodic: whether the motion was taken from its lines.
        torque: drive torques at the drives' instants [N.m or N], shape (n, K); None for an external model.
        wrench: base wrench at the plate's instants [N, N.m], shape (6, L); None for an internal model.
    """

    motion: SmoothMotion
    periodic: bool
    torque: FloatArray | None
    wrench: FloatArray | None


def recorded_motion(data: Dataset) -> tuple[SmoothMotion, bool]:
    """Motion of a recording on a uniform grid: from its lines where it repeats, filtered elsewhere.

    Args:
        data: the recording.

    Returns:
        The motion, and whether it repeats.
    """
    motion = smooth(data.position)
    if data.facts.fundamental_hz is None and data.kind in ("validation", "free"):
        return motion, False
    names = tuple(f"joint {k + 1}" for k in range(len(data.position.values)))
    try:
        window = find_window(data, names)
        trajectory = unfiltered(
            fit_trajectory(data.position, window, data.facts.harmonics), data.filters.get("position")
        )
    except NotPeriodicError:
        return motion, False
    inside = (motion.t_s >= window.start_s) & (motion.t_s < window.stop_s)
    parts = []
    for filtered, lines in zip(
        (motion.q, motion.qd, motion.qdd), trajectory.evaluate(motion.t_s[inside]), strict=True
    ):
        whole = filtered.copy()
        whole[:, inside] = lines
        parts.append(whole)
    return replace(
        motion, q=parts[0], qd=parts[1], qdd=parts[2], valid=inside
    ), True  # the transient is only filtered


def simulate(full: FullModel, data: Dataset) -> Simulated:
    """Predict every channel of a recording along its motion, at its own instants.

    Args:
        full: the model.
        data: the recording; joints in the robot's order.

    Returns:
        Drive torques and wrench.
    """
    motion, periodic = recorded_motion(data)
    n = full.model.robot.n
    extra = _effects(full, motion)
    torque = wrench = None
    if full.model.kind != "external" and data.drive_signal is not None:
        torque = _stream(full, motion, data.drive_signal.t_s, True, data.filters.get("current"), extra[:n])
    if full.model.kind != "internal" and data.wrench is not None:
        wrench = _stream(full, motion, data.wrench.t_s, False, data.filters.get("wrench"), extra[n:])
    return Simulated(motion, periodic, torque, wrench)


def _effects(full: FullModel, motion: SmoothMotion) -> FloatArray:
    """All effects on the motion's grid, drive rows then wrench rows, shape (rows, B)."""
    has_wrench = full.model.kind != "internal"
    t = motion.t_s - motion.t_s[0]
    scene = Scene(full.model, full.theta, full.scale, t, motion.q, motion.qd, motion.qdd, False, has_wrench)
    total = np.zeros((scene.rows, len(t)))
    for item in full.effects:
        part = np.tensordot(_columns(scene, item), item.values, axes=([1], [0]))
        total += part if item.course is None else part * item.course.at(motion.t_s)
    return total


def _columns(scene: Scene, item: AppliedEffect) -> FloatArray:
    if item.course is not None and item.course.kind == "dying_out" and item.effect.settling is not None:
        return item.effect.settling(scene, item.place)
    return item.effect.columns(scene, item.place, item.shape)


def _stream(
    full: FullModel,
    motion: SmoothMotion,
    t_s: FloatArray,
    drives: bool,
    anti_alias: AntiAliasFilter | None,
    extra: FloatArray,
) -> FloatArray:
    t_s = np.clip(t_s, motion.t_s[0], motion.t_s[-1])
    if anti_alias is None:
        return _rows(full, motion, t_s, drives) + interpolate.interp1d(motion.t_s, extra)(t_s)
    series = anti_alias.apply(_rows(full, motion, motion.t_s, drives) + extra, motion.rate_hz)
    return interpolate.interp1d(motion.t_s, series)(t_s)


def _rows(full: FullModel, motion: SmoothMotion, t_s: FloatArray, drives: bool) -> FloatArray:
    """The linear model at instants, shape (channels, K)."""
    model, parts = full.model, []
    speed_std = (np.abs(model.robot.drive_matrix) @ motion.velocity_std)[:, None]
    stands = _standing(drive_velocity(model.robot, motion.qd), speed_std, motion.rate_hz)
    for first in range(0, len(t_s), _CHUNK):
        t = t_s[first : first + _CHUNK]
        q, qd, qdd = motion.at(t)
        if drives:
            speed = drive_velocity(model.robot, qd)
            at = np.clip(np.round((t - motion.t_s[0]) * motion.rate_hz).astype(int), 0, len(motion.t_s) - 1)
            faded = np.clip(speed / np.maximum(_STANDING * speed_std, 1e-12), -1.0, 1.0)
            rows = model.drive_rows(q, qd, qdd, sign=np.where(stands[:, at], faded, np.sign(speed)))
        else:
            rows = model.wrench_rows(q, qd, qdd)
        parts.append(np.tensordot(rows.columns, full.theta, axes=([1], [0])) + rows.known)
    return np.concatenate(parts, axis=1)


def _standing(speed: FloatArray, speed_std: FloatArray, rate_hz: float) -> FloatArray:
    """Drives at rest for a while, shape (n, B): their friction fades instead of following the encoder's noise."""
    slow = np.abs(speed) < _STANDING * speed_std
    length = max(int(_STANDS_S * rate_hz), 1)
    return ndimage.binary_opening(slow, np.ones((1, length)))
