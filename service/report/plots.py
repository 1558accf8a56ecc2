"""The report's pictures, each made from a part of ``diagnosis.json``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from service.report.svg import (
    AFTER,
    BEFORE,
    GRID,
    INK,
    MODEL,
    NOISE,
    SOFT,
    Axes,
    line,
    number,
    picture,
    rect,
    text,
    ticks,
)

WIDTH = 720.0
_CELL_FULL = 8.0  # std of the noise at which a cell of the map has its full colour


def words(name: str) -> str:
    """A name from the file as people read it."""
    return name.replace("_", " ")


def variable_words(variable: str) -> str:
    """``velocity:joint_2`` as ``velocity of joint 2``."""
    head, _, tail = variable.partition(":")
    return (
        f"{words(head)} of {words(tail)}"
        if tail
        else words(head) + (" of the run or period" if head == "time" else "")
    )


def curve_plot(curve: dict[str, Any]) -> str:
    """Measured residual with its noise band against the model's curve, over the effect's own variable."""
    rows = [
        row
        for row in zip(curve["x"], curve["measured"], curve["band"], curve["model"], strict=True)
        if all(value is not None for value in row)
    ]
    if len(rows) < 2:
        return ""
    xs, measured, band, model = (list(column) for column in zip(*rows, strict=True))
    top = max(max(m + 2 * b for m, b in zip(measured, band, strict=True)), *model)
    low = min(min(m - 2 * b for m, b in zip(measured, band, strict=True)), *model)
    pad = 0.08 * (top - low or 1.0)
    axes = Axes(70, 34, WIDTH - 90, 230, (min(xs), max(xs)), (low - pad, top + pad))
    unit = f" [{curve['unit']}]" if curve["unit"] else ""
    axes.frame(variable_words(curve["variable"]) + unit, f"{words(curve['channel'])} [{curve['value_unit']}]")
    axes.area(
        xs,
        [m - 2 * b for m, b in zip(model, band, strict=True)],
        [m + 2 * b for m, b in zip(model, band, strict=True)],
        "#f7e6cf",
    )
    axes.path(xs, model, MODEL, 2.6)
    for x, y, half in zip(xs, measured, band, strict=True):
        axes.dot(
            x, y, AFTER, 2 * half, f"{number(x)}: {number(y)} ± {number(2 * half)} {curve['value_unit']}"
        )
    return picture(WIDTH, 310, [_legend_curve(), *axes.parts], "measured residual against the model's curve")


def _legend_curve() -> str:
    dot = f'<circle cx="78" cy="14" r="3.2" fill="{AFTER}"/>'
    return (
        line(78, 7, 78, 21, AFTER, 1.2)
        + dot
        + text(88, 18, "measured: what is left without this effect (± 2 std of the noise)")
        + rect(500, 8, 26, 12, "#f7e6cf")
        + line(500, 14, 526, 14, MODEL, 2.6)
        + text(532, 18, "model of the effect (± noise)")
    )


def misfit_map(entries: Sequence[dict[str, Any]], channels: Sequence[str]) -> str:
    """Joint by region: how many std of the noise the baseline leaves, from the lowest to the highest value of a state."""
    shown: list[dict[str, Any]] = []
    for channel in channels:
        own = sorted((e for e in entries if e["channel"] == channel), key=lambda e: -e["excess"])
        mine = [e for e in own if e["variable"].endswith(f":{channel}")]
        shown += (mine + [e for e in own if e not in mine])[: 3 if mine else 1]
    quiet = [c for c in channels if c not in {e["channel"] for e in shown}]
    if not shown:
        return ""
    row_height, left, cells = 27.0, 262.0, len(shown[0]["sigma"])
    width = (WIDTH - left - 70) / cells
    parts = [
        text(left, 14, "low", 11, "start", SOFT),
        text(left + cells * width, 14, "high", 11, "end", SOFT),
    ]
    y = 22.0
    last = None
    for entry in shown:
        if entry["channel"] != last:
            parts += [
                line(0, y, WIDTH, y, GRID),
                text(0, y + 18, words(entry["channel"]), 13, extra='font-weight="600"'),
            ]
        parts.append(text(left - 8, y + 18, variable_words(entry["variable"]), 12, "end", SOFT))
        for k, sigma in enumerate(entry["sigma"]):
            title = f"at {number(entry['centres'][k])}: {number(sigma)} std of the noise"
            parts.append(
                rect(left + k * width + 1, y + 2, width - 2, row_height - 4, _heat(sigma or 0.0), title)
            )
        strongest = max(abs(v or 0.0) for v in entry["sigma"])
        parts.append(text(WIDTH, y + 18, f"{strongest:.0f} std", 12, "end", SOFT))
        y, last = y + row_height, entry["channel"]
    parts.append(line(0, y, WIDTH, y, GRID))
    if quiet:
        parts.append(
            text(0, y + 18, "Nothing beyond noise: " + ", ".join(words(c) for c in quiet), 12, colour=SOFT)
        )
        y += 24
    return picture(WIDTH, y + 38, [*parts, _heat_scale(left, y + 10)], "map of the misfit")


def _heat(sigma: float) -> str:
    """Blue below, red above, white within the noise."""
    share = min(max(abs(sigma) - 2.0, 0.0) / (_CELL_FULL - 2.0), 1.0)
    far = (192, 57, 43) if sigma > 0 else (31, 97, 160)
    mixed = [round(247 + (c - 247) * share) for c in far]
    return f"rgb({mixed[0]},{mixed[1]},{mixed[2]})"


def _heat_scale(x: float, y: float) -> str:
    values = (-8, -5, -3, 0, 3, 5, 8)
    parts = [
        rect(x + 30 * k, y, 28, 12, _heat(v))
        + text(x + 30 * k + 14, y + 24, f"{v:+d}" if v else "0", 10, "middle", SOFT)
        for k, v in enumerate(values)
    ]
    return "".join(parts) + text(
        x + 30 * len(values) + 8, y + 11, "std of the noise; white: within noise", 11, colour=SOFT
    )


def before_after(tables: dict[str, Any], title: str) -> str:
    """Bars of RMS before and after in units of the noise floor, the bootstrap interval on the bar after."""
    channels = [c for c in tables["before"] if tables["noise"].get(c)]
    if not channels:
        return ""
    intervals = tables.get("gain_interval", {})
    ratios = {
        c: (tables["before"][c] / tables["noise"][c], tables["after"][c] / tables["noise"][c])
        for c in channels
    }
    most = max(1.6, *(max(pair) for pair in ratios.values())) * 1.05
    left, group = 88.0, 38.0
    right = WIDTH - 170

    def x_of(ratio: float) -> float:
        return left + (right - left) * ratio / most

    parts = [text(0, 16, title, 13, extra='font-weight="600"')]
    bottom = 30 + group * len(channels)
    for value in [v for v in ticks(0.0, most, 6) if v > 0]:
        parts += [
            line(x_of(value), 26, x_of(value), bottom, GRID),
            text(x_of(value), bottom + 14, number(value), 11, "middle", SOFT),
        ]
    for k, channel in enumerate(channels):
        y, (before, after) = 30 + group * k, ratios[channel]
        noise, unit = tables["noise"][channel], "N" if channel.startswith("force") else "N.m"
        parts.append(text(left - 8, y + 19, words(channel), 12, "end"))
        parts.append(
            rect(
                left,
                y + 3,
                x_of(before) - left,
                12,
                BEFORE,
                f"before {number(tables['before'][channel])} {unit}",
            )
        )
        parts.append(
            rect(
                left,
                y + 17,
                x_of(after) - left,
                12,
                AFTER,
                f"after {number(tables['after'][channel])} {unit}",
            )
        )
        if channel in intervals and None not in intervals[channel]:
            low, high = ((tables["before"][channel] - g) / noise for g in intervals[channel])
            parts += [line(x_of(low), y + 23, x_of(high), y + 23, INK, 1.6)]
            parts += [line(x_of(v), y + 19, x_of(v), y + 27, INK, 1.6) for v in (low, high)]
        label = f"{number(tables['before'][channel])} → {number(tables['after'][channel])} {unit}"
        parts.append(text(WIDTH, y + 19, label, 12, "end", SOFT))
    parts.append(line(x_of(1.0), 24, x_of(1.0), bottom, INK, 1.4, 'stroke-dasharray="5 3"'))
    parts.append(
        text(
            left + (right - left) / 2,
            bottom + 30,
            "RMS in units of the noise (dashed line: nothing but noise is left)",
            12,
            "middle",
        )
    )
    return picture(WIDTH, bottom + 38, [*parts, _legend_bars()], title)


def _legend_bars() -> str:
    x = WIDTH - 330
    return (
        rect(x, 5, 14, 12, BEFORE)
        + text(x + 20, 16, "before")
        + rect(x + 80, 5, 14, 12, AFTER)
        + text(x + 100, 16, "after")
        + line(x + 150, 11, x + 176, 11, INK, 1.6)
        + line(x + 150, 7, x + 150, 15, INK, 1.6)
        + line(x + 176, 7, x + 176, 15, INK, 1.6)
        + text(x + 182, 16, "95 % interval of the gain", 12)
    )


def constants_plot(constants: Sequence[dict[str, Any]]) -> str:
    """Torque constants against the robot file's, with two std."""
    rows = [k for k in constants if k["value"] is not None and k["nominal"]]
    if not rows:
        return ""
    shares = [(100 * (k["value"] / k["nominal"] - 1), 200 * k["std"] / k["nominal"]) for k in rows]
    reach = max(1.0, *(abs(e) + s for e, s in shares)) * 1.15
    height = 28.0 * len(rows)
    axes = Axes(88, 10, WIDTH - 88 - 200, height, (-reach, reach), (0.0, 1.0))
    for value in ticks(-reach, reach, 6):
        axes.parts += [
            line(axes.px(value), 10, axes.px(value), 10 + height, GRID),
            text(axes.px(value), height + 25, f"{number(value)} %", 11, "middle", SOFT),
        ]
    axes.parts.append(line(axes.px(0), 8, axes.px(0), 10 + height, INK, 1.4, 'stroke-dasharray="5 3"'))
    for k, (row, (share, two)) in enumerate(zip(rows, shares, strict=True)):
        y = 10 + 28.0 * (k + 0.5)
        axes.parts.append(text(80, y + 4, words(row["joint"]), 12, "end"))
        axes.parts.append(line(axes.px(share - two), y, axes.px(share + two), y, AFTER, 2.4))
        axes.parts.append(f'<circle cx="{axes.px(share):.1f}" cy="{y:.1f}" r="4.5" fill="{AFTER}"/>')
        label = f"{row['value']:.4g} ± {row['std']:.2g} N.m/A (file {row['nominal']:.4g})"
        axes.parts.append(text(WIDTH, y + 4, label, 12, "end", SOFT))
    axes.parts.append(
        text(axes.px(0), height + 42, "deviation from the robot file (bar: ± 2 std)", 12, "middle")
    )
    return picture(WIDTH, height + 50, axes.parts, "torque constants")


def share_bar(share: float | None, width: float = 120.0) -> str:
    """A small bar of a share between 0 and 1."""
    if share is None:
        return ""
    colour = BEFORE if share > 0.95 else NOISE
    return picture(
        width,
        12,
        [rect(0, 1, width, 10, "#eef1f4"), rect(0, 1, width * share, 10, colour)],
        f"{100 * share:.0f} %",
    )
