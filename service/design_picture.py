"""A design at a glance: angles and velocities under their limits, the path, what each parameter gains."""

from __future__ import annotations

import numpy as np

from identify.excitation.design import Design
from identify.excitation.workspace import link_poses
from identify.robot import Robot
from service.drawing import Drawing, Panel

_COLOURS = ("#1f6fb4", "#d1495b", "#2e8b57", "#8e5ea2", "#c98a1b", "#3c9d9b", "#555555")
_LIMIT, _DESIGN, _PLAIN = "#cc3333", "#1f6fb4", "#c9c9c9"
_ROW, _WIDE, _LEFT, _GAP, _TOP = 110, 330, 70, 90, 60
_BAR = 14


def draw_design(result: Design, robot: Robot) -> str:
    """Draw a design.

    Args:
        result: the design.
        robot: its robot, for the path in space.

    Returns:
        An SVG document.
    """
    n = len(result.joints)
    names = [name for name, std in result.expected.std.items() if np.isfinite(std)]
    height = _TOP + n * (_ROW + 40) + 330 + _BAR * len(names) + 60
    drawing = Drawing(2 * _WIDE + _LEFT + _GAP + 40, height)
    drawing.words(
        _LEFT,
        24,
        f"{result.robot}: {n} joints, {result.series.harmonics} harmonics of "
        f"{result.series.fundamental_hz:g} Hz, "
        f"criterion {result.options.criterion}, {result.model} model",
        15,
    )
    _draw_motion(drawing, result)
    _draw_path(drawing, result, robot, _TOP + n * (_ROW + 40) + 10)
    _draw_parameters(drawing, result, names, _TOP + n * (_ROW + 40) + 330)
    return drawing.text()


def _padded(low: float, high: float) -> tuple[float, float]:
    room = 0.06 * max(high - low, 1e-9)
    return low - room, high + room


def _draw_motion(drawing: Drawing, result: Design) -> None:
    t_s = result.series.grid_s(400)
    q, qd, _ = result.series.evaluate(t_s)
    limits, period = result.limits, result.series.period_s
    for k, name in enumerate(result.joints):
        top, colour = _TOP + k * (_ROW + 40), _COLOURS[k % len(_COLOURS)]
        angle = Panel(
            drawing, (_LEFT, top, _WIDE, _ROW), (0.0, period), _padded(limits.lower[k], limits.upper[k])
        )
        angle.frame(f"{name}: position [rad or m] over time [s]")
        fastest = limits.velocity[k] if np.isfinite(limits.velocity[k]) else np.abs(qd[k]).max()
        speed = Panel(
            drawing, (_LEFT + _WIDE + _GAP, top, _WIDE, _ROW), (0.0, period), _padded(-fastest, fastest)
        )
        speed.frame("velocity [rad/s or m/s]")
        for panel, values, ends in (
            (angle, q[k], (limits.lower[k], limits.upper[k])),
            (speed, qd[k], (-limits.velocity[k], limits.velocity[k])),
        ):
            panel.curve(t_s, values, colour)
            for end in ends:
                panel.level(end, _LIMIT)


def _draw_path(drawing: Drawing, result: Design, robot: Robot, top: float) -> None:
    q = result.series.evaluate(result.series.grid_s(400))[0]
    poses = link_poses(robot, q)
    reach = (
        float(np.mean([np.linalg.norm(j.translation_m) for j in robot.joints[1:]])) if robot.n > 1 else 0.3
    )
    # a point off the last joint's axis by the length of a typical link
    off = (
        np.eye(3)[int(np.argmin(np.abs(robot.joints[-1].axis)))]
        if robot.n == 1
        else np.array([0.0, 0.0, 1.0])
    )
    tip = poses.origin_m[-1] + max(reach, 0.05) * np.einsum("ijn,j->in", poses.rotation[-1], off)
    centre, half = 0.5 * (tip.max(axis=1) + tip.min(axis=1)), 0.55 * float(np.ptp(tip, axis=1).max()) + 1e-6
    for column, (a, b, title) in enumerate(
        ((0, 2, "tip from the side: z over x [m]"), (0, 1, "from above: y over x [m]"))
    ):
        box = (_LEFT + column * (_WIDE + _GAP), top + 10, 260.0, 260.0)
        panel = Panel(
            drawing, box, (centre[a] - half, centre[a] + half), (centre[b] - half, centre[b] + half)
        )
        panel.frame(title)
        panel.curve(tip[a], tip[b], _DESIGN, 1.2)


def _draw_parameters(drawing: Drawing, result: Design, names: list[str], top: float) -> None:
    drawing.words(
        _LEFT,
        top - 8,
        "Expected std before the run: this design (blue) and a motion drawn by hand (grey), log scale",
    )
    ratios = [result.plain.std[name] / result.expected.std[name] for name in names]
    longest = max([np.log10(r) for r in ratios if np.isfinite(r) and r > 0] + [0.1])
    left, width = 260.0, 330.0
    for row, (name, ratio) in enumerate(zip(names, ratios, strict=True)):
        y = top + row * _BAR
        drawing.words(left - 8, y + 10, name, 10, "end")
        gain = np.log10(ratio) if np.isfinite(ratio) else longest
        own = width * 0.6
        drawing.bar(left, y + 1, own + width * 0.4 * gain / longest, 4.5, _PLAIN)
        drawing.bar(left, y + 6, own, 5, _DESIGN)
        factor = f"{ratio:.2g} times larger by hand" if np.isfinite(ratio) else "not seen by hand"
        drawing.words(left + width + 12, y + 10, f"{result.expected.std[name]:.2g}, {factor}", 10)
