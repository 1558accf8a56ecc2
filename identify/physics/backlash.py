"""A gear with play: the link lies on one flank or the other, by the sign of the load."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, Shape
from identify.physics.loose_links import links_along
from identify.physics.scene import Scene
from identify.rotations import FloatArray

_LONG = 20.0  # a crossing is over (3e-6 of it left) after this many times 1 / (2 pi f)


def _edges(scene: Scene, joint: int) -> tuple[FloatArray, FloatArray]:
    """Instants [s] at which the load changes sign, and the change (+-2)."""
    load = scene.load[joint]
    last, start = np.roll(load, 1), np.roll(scene.t_s, 1)
    at = np.flatnonzero((last > 0.0) != (load > 0.0))
    if not scene.periodic:
        at = at[at > 0]
    share = last[at] / (last[at] - load[at])
    instants = np.where(at > 0, start[at], scene.t_s[0] - scene.step_s) + share * scene.step_s
    return instants, np.where(load[at] > 0.0, 2.0, -2.0)


def _crossing(elapsed: FloatArray, rate: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smooth unit step of four equal lags (no jump of the jerk), with its first and second rates."""
    x = elapsed * rate
    fade = np.exp(-x)
    rise = 1.0 - fade * (1.0 + x + x**2 / 2.0 + x**3 / 6.0)
    return rise, rate * x**3 / 6.0 * fade, rate**2 * (x**2 / 2.0 - x**3 / 6.0) * fade


def _side(scene: Scene, joint: int, crossing_hz: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Which flank carries, -1 to 1, and its two rates, each shape (B,)."""
    rate = 2.0 * np.pi * crossing_hz
    value, slope, bend = np.sign(scene.load[joint]), np.zeros_like(scene.t_s), np.zeros_like(scene.t_s)
    period = len(scene.t_s) * scene.step_s
    for instant, change in zip(*_edges(scene, joint), strict=True):
        elapsed = scene.t_s - instant
        if scene.periodic:
            elapsed = elapsed % period
        recent = (elapsed >= 0.0) & (elapsed * rate < _LONG)
        step = _crossing(elapsed[recent], rate)
        value[recent] += change * (step[0] - 1.0)
        slope[recent] += change * step[1]
        bend[recent] += change * step[2]
    return value, slope, bend


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    parts = (-0.5 * part for part in _side(scene, joint, shape["f"]))
    return links_along(scene, joint, *parts)[:, None]


EFFECT = Effect(
    name="backlash",
    where="B",
    parity="E",
    coefficients=(Coefficient("b", "rad", +1),),
    columns=_columns,
    places=every_drive,
    sentence=(
        "{place} has a gear with play of {b}: its link falls from one flank to the other whenever the "
        "load changes sign, at {f}."
    ),
    reference=(
        "link = motor - (b / 2) sgn(tau_l), crossed smoothly; at reversals of the load, not of the speed"
    ),
    shapes=(Shape("f", "Hz", (5.0, 8.0, 12.0, 18.0, 27.0, 40.0)),),
)
