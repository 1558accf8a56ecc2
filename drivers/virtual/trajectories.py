"""Motions to record: Fourier series (Verdonck 2001, equation 14) and point to point with full stops."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.urdf_tree import read_tree


class Trajectory(Protocol):
    """Joint angles as a function of time."""

    @property
    def duration_s(self) -> float:
        """Length of the motion, or of one period."""
        ...

    def position(self, t_s: np.ndarray) -> np.ndarray:
        """Joint angles (n, k) at instants (n,)."""
        ...


@dataclass(frozen=True)
class FourierMotion:
    """q_j(t) = offset + sum of cosine and sine lines of one fundamental (14)."""

    fundamental_hz: float
    offset_rad: np.ndarray
    cosine_rad: np.ndarray
    """(k, harmonics)."""
    sine_rad: np.ndarray

    @property
    def duration_s(self) -> float:
        """One period."""
        return 1.0 / self.fundamental_hz

    @property
    def harmonics(self) -> int:
        """Number of lines."""
        return int(self.cosine_rad.shape[1])

    def position(self, t_s: np.ndarray) -> np.ndarray:
        """Joint angles (n, k) at instants (n,)."""
        line = np.arange(1, self.harmonics + 1)
        phase = 2.0 * np.pi * self.fundamental_hz * np.outer(t_s, line)
        return np.asarray(
            self.offset_rad + np.cos(phase) @ self.cosine_rad.T + np.sin(phase) @ self.sine_rad.T
        )

    def reversed(self) -> FourierMotion:
        """The same path run backwards: negate the sines."""
        return FourierMotion(self.fundamental_hz, self.offset_rad, self.cosine_rad, -self.sine_rad)


def fourier_from_excitation(excitation: Mapping[str, Any]) -> FourierMotion:
    """Read the coefficients of an `excitation.json`."""
    return FourierMotion(
        float(excitation["fundamental_hz"]),
        np.array(excitation["offset"], dtype=float),
        np.array(excitation["cosine"], dtype=float),
        np.array(excitation["sine"], dtype=float),
    )


def random_fourier(
    plant: PlantSpec, seed: int, fundamental_hz: float = 0.1, harmonics: int = 5, share: float = 0.8
) -> FourierMotion:
    """Random excitation inside `share` of the URDF's angle and speed limits; no optimum, but rich."""
    random = np.random.default_rng(seed)
    lower, upper, speed = joint_limits(plant)
    shape = random.standard_normal((2, len(lower), harmonics)) / np.arange(1, harmonics + 1)
    motion = FourierMotion(fundamental_hz, np.zeros(len(lower)), shape[0], shape[1])
    t_s = np.linspace(0.0, motion.duration_s, 2000)
    q = motion.position(t_s)
    reach, fast = np.ptp(q, axis=0), np.abs(np.gradient(q, t_s, axis=0)).max(axis=0)
    scale = share * np.minimum((upper - lower) / reach, speed / fast)
    middle = 0.5 * (lower + upper) - scale * 0.5 * (q.max(axis=0) + q.min(axis=0))
    return FourierMotion(fundamental_hz, middle, shape[0] * scale[:, None], shape[1] * scale[:, None])


@dataclass(frozen=True)
class PointToPoint:
    """Quintic moves between points with full stops: zero speed and acceleration at every point."""

    points_rad: np.ndarray
    """(points, k)."""
    start_s: np.ndarray
    """(points - 1,) when each move starts."""
    move_s: np.ndarray
    duration_s: float

    def position(self, t_s: np.ndarray) -> np.ndarray:
        """Joint angles (n, k) at instants (n,)."""
        t = np.asarray(t_s, dtype=float)
        move = np.clip(np.searchsorted(self.start_s, t, side="right") - 1, 0, len(self.start_s) - 1)
        u = np.clip((t - self.start_s[move]) / self.move_s[move], 0.0, 1.0)[:, None]
        blend = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        a, b = self.points_rad[move], self.points_rad[move + 1]
        return np.asarray(np.where(u >= 1.0, b, a + (b - a) * blend))


def random_points(
    plant: PlantSpec, seed: int, points: int = 20, dwell_s: float = 0.5, share: float = 0.8
) -> PointToPoint:
    """Random points inside `share` of the limits, from and back to the middle, stopping at each."""
    random = np.random.default_rng(seed)
    lower, upper, speed = joint_limits(plant)
    middle, half = 0.5 * (lower + upper), 0.5 * share * (upper - lower)
    rest = np.clip(np.zeros_like(middle), lower, upper)
    targets = middle + half * random.uniform(-1.0, 1.0, (points, len(lower)))
    path = np.vstack([rest, targets])
    peak = 1.875  # top speed of a quintic over its mean speed
    move_s = np.maximum(peak * np.max(np.abs(np.diff(path, axis=0)) / (share * speed), axis=1), 0.8)
    start_s = dwell_s + np.concatenate([[0.0], np.cumsum(move_s + dwell_s)[:-1]])
    return PointToPoint(path, start_s, move_s, float(start_s[-1] + move_s[-1] + dwell_s))


def joint_limits(plant: PlantSpec) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lower, upper angle and speed limit (k,) of the URDF, in the plant's joint order."""
    tree = read_tree(plant.urdf_text)
    joints = [tree.joint(name) for name in plant.joint_names]
    table = np.array([(joint.lower, joint.upper, joint.velocity) for joint in joints])
    return table[:, 0], table[:, 1], table[:, 2]
