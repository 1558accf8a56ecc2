"""The sections of the report, each HTML made from a part of ``diagnosis.json``."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from service.report.comparison import against_section
from service.report.plots import (
    before_after,
    constants_plot,
    curve_plot,
    misfit_map,
    share_bar,
    variable_words,
    words,
)
from service.report.svg import number


def table(
    headings: Sequence[str], rows: Sequence[Sequence[str]], numeric: Sequence[int] = (), kind: str = ""
) -> str:
    """A table of cells that are HTML already."""

    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(
            f'<{tag} class="n">{cell}</{tag}>' if k in numeric else f"<{tag}>{cell}</{tag}>"
            for k, cell in enumerate(row)
        )

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return (
        f"<table class='{kind}'><thead><tr>{cells('th', headings)}</tr></thead><tbody>{body}</tbody></table>"
    )


def where(content: dict[str, Any]) -> str:
    """Where the misfit sits."""
    location = content["location"]["verdict"]
    picture = misfit_map(content.get("map", []), list(content["fit"]["training"]["before"]))
    note = (
        '<p class="note">Each row runs from the lowest to the highest value of a state; colour is what the plain model leaves '
        "there, in std of the noise.</p>"
        if picture
        else '<p class="note">No region of any joint stands out of the noise.</p>'
    )
    return (
        f"<h2>Where</h2><p>{escape(location[0].upper() + location[1:])}.</p><figure>{picture}</figure>{note}"
    )


def physics(content: dict[str, Any]) -> str:
    """Which physics: every finding with its curve and numbers."""
    if not content["findings"]:
        nothing = "explains what is left" if content["unexplained"] else "is needed"
        return f"<h2>Which physics</h2><p>No effect of the catalogue {nothing}.</p>"
    curves = {curve["finding"]: curve for curve in content.get("curves", [])}
    cards = [_finding(item, curves.get(k)) for k, item in enumerate(content["findings"])]
    return "<h2>Which physics</h2>" + "".join(cards)


def _finding(item: dict[str, Any], curve: dict[str, Any] | None) -> str:
    place = item["joint"] or item["channel"] or "whole robot"
    rows = [
        (
            escape(words(p["name"])),
            number(p["value"], 4),
            "–" if p["std"] is None else f"± {number(p['std'], 2)}",
            escape(p["unit"]),
        )
        for p in item["parameters"]
    ]
    where_ = item["where"]
    facts = (
        f'<p class="note">Shows in {escape(", ".join(words(c) for c in where_["channels"]))}; {escape(where_["region"])}. '
        f"Chance that noise alone looks like this: {_chance(item['p_value'])}.</p>"
    )
    rivals = ""
    if item["alternatives"]:
        tags = "".join(f'<span class="tag">{escape(words(name))}</span>' for name in item["alternatives"])
        rivals = f"<p><b>These data cannot tell it from:</b> {tags}</p>"
    picture = f"<figure>{curve_plot(curve)}</figure>" if curve else ""
    return (
        f'<div class="card"><h3>{escape(words(item["effect"]))} · {escape(words(place))}</h3>'
        f'<p class="lead">{escape(item["sentence"])}</p>{picture}'
        f"{table(('parameter', 'value', 'std', 'unit'), rows, (1, 2), 'small')}{facts}{rivals}</div>"
    )


def _chance(p_value: float) -> str:
    return "below 1e-300" if p_value <= 1e-300 else number(p_value, 2)


def unexplained(content: dict[str, Any]) -> str:
    """What is left without a name."""
    rest = content["unexplained"]
    if rest is None:
        return ""
    tags = "".join(f'<span class="tag">{escape(variable_words(v))}</span>' for v in rest["depends_on"])
    depends = f"<p>It depends on: {tags}</p>" if tags else ""
    return f'<h2>Unexplained</h2><div class="card open"><p class="lead">{escape(rest["sentence"])}</p>{depends}</div>'


def fit(content: dict[str, Any]) -> str:
    """Before and after, on the run and on the held-out recording."""
    tables = content["fit"]
    result, held = "<h2>Before and after</h2>", tables["validation"]
    result += "".join(
        f'<div class="warn">{escape(item["sentence"])}</div>' for item in held.get("rejected", [])
    )
    if held["before"]:
        result += f"<figure>{before_after(held, 'On a recording not used in the fit')}</figure>"
    elif not held.get("rejected"):
        result += "<p>No held-out recording was given: the gain on the run itself proves less.</p>"
    trained = before_after(tables["training"], "On the run itself, averaged over its periods")
    result += f"<figure>{trained}</figure>"
    notes = "".join(f"<p class='note'>{escape(note)}</p>" for note in tables["validation"].get("notes", []))
    return result + notes


def torque_constants(content: dict[str, Any]) -> str:
    """Torque constants with their uncertainty."""
    constants = content.get("estimate", {}).get("torque_constants", [])
    picture = constants_plot(constants)
    reasons = dict.fromkeys(k["reason"] for k in constants if k.get("reason"))
    notes = "".join(f'<p class="note">Not known: {escape(reason)}.</p>' for reason in reasons)
    return f"<h2>Torque constants</h2><figure>{picture}</figure>{notes}" if picture or notes else ""


def blind_spots(content: dict[str, Any]) -> str:
    """What this recording could not have shown."""
    spots = sorted(content["blind_spots"], key=_blindness)
    rows = []
    for spot in spots:
        size = number(spot["smallest_detectable"], 2)
        share = spot.get("swallowed")
        shown = "" if share is None else f"{100 * share:.0f} %"
        hidden = escape(", ".join(words(name) for name in spot["confused_with"])) or escape(
            spot.get("reason", "")
        )
        rows.append(
            (
                escape(words(spot["effect"])),
                size,
                escape(spot["unit"]),
                escape(words(spot.get("place") or "")),
                share_bar(share),
                shown,
                hidden,
            )
        )
    head = (
        "effect",
        "smallest visible",
        "unit",
        "at best in",
        "absorbed by the model",
        "",
        "looks like / why not",
    )
    return (
        "<h2>Blind spots</h2><p>The smallest size of every effect that this recording would have shown with 90 % certainty. "
        "The bar is the share of the effect that the model's own parameters absorb: red is all but invisible.</p>"
        + table(head, rows, (1, 5))
    )


def _blindness(spot: dict[str, Any]) -> tuple[int, float]:
    if spot["smallest_detectable"] is None:
        return (0 if "absorb" in spot.get("reason", "") else 2, 0.0)
    return (1, -(spot.get("swallowed") or 0.0))


def next_experiment(content: dict[str, Any]) -> str:
    """What to record next."""
    found = content.get("next_experiment")
    if not found:
        return ""
    if isinstance(found, str):
        return f"<h2>Next experiment</h2><p>{escape(found)}</p>"
    sentence = found.get("sentence", "")
    rows = [
        (escape(words(str(k))), escape(str(v)))
        for k, v in found.items()
        if k != "sentence" and not isinstance(v, list | dict)
    ]
    return f'<h2>Next experiment</h2><p class="lead">{escape(str(sentence))}</p>' + (
        table(("", ""), rows) if rows else ""
    )


def against(content: dict[str, Any]) -> str:
    """The comparison with a reference, where one was given."""
    found = content.get("against")
    return against_section(found, table) if found else ""


def warnings(content: dict[str, Any]) -> str:
    """What the reader must know."""
    if not content["warnings"]:
        return ""
    return "<h2>Warnings</h2>" + "".join(
        f'<div class="warn">{escape(text)}</div>' for text in content["warnings"]
    )
