"""The lower convex hull of delays: the line that no arrival can undercut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Line:
    """y = height + slope (x - x0)."""

    x0: float
    height: float
    slope: float

    def at(self, x: np.ndarray | float) -> np.ndarray | float:
        """Return the line's height at ``x``."""
        return self.height + self.slope * (x - self.x0)


def lower_hull(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the indices of the lower hull's corners, left to right.

    Args:
        x: (n,) not decreasing.
        y: (n,).

    Source: A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions", 1979.
    """
    corners: list[int] = []
    xs, ys = x.tolist(), y.tolist()
    for index in range(len(xs)):
        while len(corners) > 1 and _is_above(xs, ys, corners[-2], corners[-1], index):
            corners.pop()
        if corners and xs[corners[-1]] == xs[index]:
            if ys[index] >= ys[corners[-1]]:
                continue
            corners.pop()
        corners.append(index)
    return np.array(corners, dtype=np.intp)


def _is_above(xs: list[float], ys: list[float], left: int, middle: int, right: int) -> bool:
    """Whether ``middle`` lies on or above the chord from ``left`` to ``right``."""
    rise = (ys[right] - ys[left]) * (xs[middle] - xs[left])
    return (ys[middle] - ys[left]) * (xs[right] - xs[left]) >= rise


def supporting_line(x: np.ndarray, y: np.ndarray, largest_slope: float) -> Line:
    """Return the line below all points that has the least total distance to them.

    It is the hull's edge over the mean of x; where that edge is steeper than two clocks can part, the line
    of the largest believable slope through the hull's corner that then supports it.

    Args:
        x: (n,) not decreasing.
        y: (n,).
        largest_slope: bound of |slope|.

    Source: L. Zhang, Z. Liu, C. H. Xia, "Clock synchronization algorithms for network measurements",
        INFOCOM 2002, section III (objective 1).
    """
    corners = lower_hull(x, y)
    hull_x, hull_y = x[corners], y[corners]
    mean_x = float(np.mean(x))
    if len(corners) == 1:
        return Line(float(hull_x[0]), float(hull_y[0]), 0.0)
    right = int(np.clip(np.searchsorted(hull_x, mean_x), 1, len(corners) - 1))
    width = hull_x[right] - hull_x[right - 1]
    slope = float(np.clip((hull_y[right] - hull_y[right - 1]) / width, -largest_slope, largest_slope))
    support = int(np.argmin(hull_y - slope * hull_x))
    return Line(float(hull_x[support]), float(hull_y[support]), slope)
