"""The report's section on a reference: an earlier calibration or another simulator."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

from service.report.plots import WIDTH, words
from service.report.svg import AFTER, BEFORE, INK, MODEL, NOISE, number, picture, rect, text

_PARTS = (
    ("parameters", "parameters", AFTER),
    ("effects", "named effects", MODEL),
    ("noise", "noise", NOISE),
    ("rest", "rest", BEFORE),
)


def against_section(found: dict[str, Any], table: Callable[..., str]) -> str:
    """Lay out the comparison.

    Args:
        found: ``against`` of ``diagnosis.json``.
        table: makes a table.

    Returns:
        HTML.
    """
    title = "Against the earlier calibration" if found["kind"] == "estimate" else "Against the simulation"
    result = f'<h2>{title}</h2><p class="lead">{escape(found["sentence"])}</p>'
    if "channels" in found:
        result += f"<figure>{_shares(found['channels'])}</figure>"
    rows = [
        (
            escape(item["name"]),
            number(item["reference"], 4),
            number(item["now"], 4),
            number(item["difference"], 3),
            number(item["std"], 2),
            f"{item['z']:+.1f}",
            escape(item["unit"]),
        )
        for item in sorted(found.get("parameters", []), key=lambda item: -abs(item["z"]))[:12]
    ]
    head = ("parameter", "reference", "now", "difference", "std", "in std", "unit")
    return result + (table(head, rows, (1, 2, 3, 4, 5)) if rows else "")


def _shares(channels: dict[str, Any]) -> str:
    """What the difference in every channel is made of, as bars of signed shares of its power."""
    left, right, row = 88.0, WIDTH - 190, 26.0
    parts = []
    for k, (_, label, colour) in enumerate(_PARTS):
        parts += [rect(left + 150 * k, 4, 14, 12, colour), text(left + 20 + 150 * k, 15, label)]
    y = 26.0
    for channel, item in channels.items():
        parts.append(text(left - 8, y + 15, words(channel), 12, "end"))
        shares = [max(item["shares"].get(key) or 0.0, 0.0) for key, _, _ in _PARTS]
        total, x = max(sum(shares), 1.0), left
        for share, (_, label, colour) in zip(shares, _PARTS, strict=True):
            width = (right - left) * share / total
            parts.append(rect(x, y + 2, width, 18, colour, f"{label}: {100 * share:.0f} % of the power"))
            if width > 34:
                parts.append(text(x + width / 2, y + 15, f"{100 * share:.0f} %", 11, "middle", "#ffffff"))
            x += width
        unit = "N" if channel.startswith("force") else "N.m"
        parts.append(
            text(
                WIDTH,
                y + 15,
                f"{number(item['difference'])} {unit}, noise {number(item['noise'])}",
                12,
                "end",
                NOISE if item["difference"] < 1.5 * (item["noise"] or 0.0) else INK,
            )
        )
        y += row
    return picture(WIDTH, y + 6, parts, "what the difference is made of")
