"""A few strokes of SVG: axes, curves, bars, words."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.sax.saxutils import escape

import numpy as np

_FONT = 'font-family="sans-serif"'
INK, FAINT = "#222222", "#bbbbbb"


@dataclass
class Drawing:
    """A picture in the making.

    Attributes:
        width: [px].
        height: [px].
    """

    width: int
    height: int
    _parts: list[str] = field(default_factory=list)

    def words(
        self, x: float, y: float, text: str, size: int = 12, anchor: str = "start", colour: str = INK
    ) -> None:
        """Write words with their baseline at (x, y)."""
        self._parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" {_FONT} font-size="{size}" '
            f'text-anchor="{anchor}" fill="{colour}">'
            f"{escape(text)}</text>"
        )

    def stroke(
        self, x: np.ndarray, y: np.ndarray, colour: str, width: float = 1.5, dashed: bool = False
    ) -> None:
        """Draw a polyline through points in pixels."""
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        dashes = ' stroke-dasharray="5 4"' if dashed else ""
        self._parts.append(
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dashes}/>'
        )

    def bar(self, x: float, y: float, width: float, height: float, colour: str) -> None:
        """Fill a rectangle."""
        self._parts.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{max(width, 0.5):.1f}" '
            f'height="{height:.1f}" fill="{colour}"/>'
        )

    def text(self) -> str:
        """Give the document."""
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width} {self.height}" '
            f'width="{self.width}" height="{self.height}">'
        )
        ground = f'<rect width="{self.width}" height="{self.height}" fill="white"/>'
        return "\n".join([head, ground, *self._parts, "</svg>"]) + "\n"


@dataclass(frozen=True)
class Panel:
    """A pair of axes on a drawing.

    Attributes:
        drawing: where it is drawn.
        box: left, top, width, height [px].
        x_range: data at left and right.
        y_range: data at bottom and top.
    """

    drawing: Drawing
    box: tuple[float, float, float, float]
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    def place(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Turn data into pixels."""
        left, top, width, height = self.box
        across = (np.asarray(x) - self.x_range[0]) / (self.x_range[1] - self.x_range[0])
        up = (np.asarray(y) - self.y_range[0]) / (self.y_range[1] - self.y_range[0])
        return left + width * across, top + height * (1.0 - up)

    def frame(self, title: str) -> None:
        """Draw the frame, its title and the ranges."""
        left, top, width, height = self.box
        x, y = left + width * np.array([0, 1, 1, 0, 0]), top + height * np.array([0, 0, 1, 1, 0])
        self.drawing.stroke(x, y, FAINT, 1.0)
        self.drawing.words(left, top - 5, title, 12)
        for value, row in ((self.y_range[1], top + 9), (self.y_range[0], top + height)):
            self.drawing.words(left - 4, row, f"{value:.3g}", 10, "end")
        for value, column, anchor in (
            (self.x_range[0], left, "start"),
            (self.x_range[1], left + width, "end"),
        ):
            self.drawing.words(column, top + height + 12, f"{value:.3g}", 10, anchor)

    def curve(self, x: np.ndarray, y: np.ndarray, colour: str, width: float = 1.5) -> None:
        """Draw data as a curve."""
        self.drawing.stroke(*self.place(x, y), colour, width)

    def level(self, value: float, colour: str) -> None:
        """Draw a dashed horizontal line, if it lies inside."""
        if self.y_range[0] <= value <= self.y_range[1]:
            self.drawing.stroke(
                *self.place(np.array(self.x_range), np.array([value, value])), colour, 1.0, True
            )
