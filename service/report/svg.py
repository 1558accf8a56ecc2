"""A few drawing primitives: an SVG text, its axes, marks with a title for the mouse."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

INK, GRID, SOFT = "#1c2733", "#dfe4ea", "#66727f"
BEFORE, AFTER, NOISE, MODEL = "#c0504d", "#1f77b4", "#9aa5b1", "#d9822b"


def number(value: float | None, digits: int = 3) -> str:
    """Write a number for people, a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.{digits}g}".replace("e-0", "e-").replace("e+0", "e")


def ticks(low: float, high: float, wanted: int = 5) -> list[float]:
    """Round numbers between two ends."""
    span = high - low
    if not span > 0.0:
        return [low]
    raw = span / wanted
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * power >= raw * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [round(k * step, 12) for k in range(first, math.floor(high / step + 1e-9) + 1)]


def text(
    x: float,
    y: float,
    words: str,
    size: float = 12,
    anchor: str = "start",
    colour: str = INK,
    extra: str = "",
) -> str:
    """A line of text."""
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" text-anchor="{anchor}" fill="{colour}" {extra}>{escape(words)}</text>'


def rect(x: float, y: float, width: float, height: float, fill: str, title: str = "", extra: str = "") -> str:
    """A filled rectangle, its title shown under the mouse."""
    inner = f"<title>{escape(title)}</title>" if title else ""
    return (
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{max(width, 0.0):.1f}" height="{max(height, 0.0):.1f}" fill="{fill}" {extra}>'
        f"{inner}</rect>"
    )


def line(
    x1: float, y1: float, x2: float, y2: float, colour: str = INK, width: float = 1.0, extra: str = ""
) -> str:
    """A straight line."""
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}" stroke-width="{width:g}" {extra}/>'


def picture(width: float, height: float, parts: Sequence[str], label: str) -> str:
    """The whole SVG, scaled to the page's width."""
    return (
        f'<svg viewBox="0 0 {width:g} {height:g}" width="{width:g}" role="img" aria-label="{escape(label, quote=True)}" '
        f'xmlns="http://www.w3.org/2000/svg">{"".join(parts)}</svg>'
    )


@dataclass
class Axes:
    """A rectangle on the page with a linear scale on either side."""

    left: float
    top: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]
    parts: list[str] = field(default_factory=list)

    def px(self, x: float) -> float:
        """Page position of a value."""
        return self.left + (x - self.x[0]) / (self.x[1] - self.x[0]) * self.width

    def py(self, y: float) -> float:
        """Page position of a value."""
        return self.top + (1.0 - (y - self.y[0]) / (self.y[1] - self.y[0])) * self.height

    def frame(self, x_label: str, y_label: str) -> None:
        """Draw grid, numbers and labels."""
        bottom = self.top + self.height
        for value in ticks(*self.x, 6):
            self.parts.append(line(self.px(value), self.top, self.px(value), bottom, GRID))
            self.parts.append(text(self.px(value), bottom + 15, number(value), 11, "middle", SOFT))
        for value in ticks(*self.y, 5):
            self.parts.append(line(self.left, self.py(value), self.left + self.width, self.py(value), GRID))
            self.parts.append(text(self.left - 6, self.py(value) + 4, number(value), 11, "end", SOFT))
        if self.y[0] < 0.0 < self.y[1]:
            self.parts.append(line(self.left, self.py(0.0), self.left + self.width, self.py(0.0), SOFT))
        self.parts.append(text(self.left + self.width / 2, bottom + 33, x_label, 12, "middle"))
        middle = self.top + self.height / 2
        turned = f'transform="rotate(-90 {self.left - 46:.1f} {middle:.1f})"'
        self.parts.append(text(self.left - 46, middle, y_label, 12, "middle", INK, turned))

    def path(self, xs: Sequence[float], ys: Sequence[float], colour: str, width: float = 2.0) -> None:
        """Draw a line through points."""
        points = " ".join(f"{self.px(x):.1f},{self.py(y):.1f}" for x, y in zip(xs, ys, strict=True))
        self.parts.append(
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width:g}"/>'
        )

    def area(self, xs: Sequence[float], low: Sequence[float], high: Sequence[float], fill: str) -> None:
        """Fill between two curves."""
        there = [f"{self.px(x):.1f},{self.py(y):.1f}" for x, y in zip(xs, high, strict=True)]
        back = [f"{self.px(x):.1f},{self.py(y):.1f}" for x, y in zip(xs, low, strict=True)]
        self.parts.append(f'<polygon points="{" ".join(there + back[::-1])}" fill="{fill}" stroke="none"/>')

    def dot(self, x: float, y: float, colour: str, half: float = 0.0, title: str = "") -> None:
        """A measured point with its bar of error."""
        if half > 0.0:
            self.parts.append(line(self.px(x), self.py(y - half), self.px(x), self.py(y + half), colour, 1.2))
        inner = f"<title>{escape(title)}</title>" if title else ""
        self.parts.append(
            f'<circle cx="{self.px(x):.1f}" cy="{self.py(y):.1f}" r="3.2" fill="{colour}">{inner}</circle>'
        )
