"""The report of a diagnosis as one HTML page, made from ``diagnosis.json`` alone."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

from service.report.headline import headline
from service.report.sections import (
    against,
    blind_spots,
    fit,
    next_experiment,
    physics,
    torque_constants,
    unexplained,
    warnings,
    where,
)
from service.report.style import CSS

_VERDICTS = {
    "consistent": "Consistent: nothing left beyond noise",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "unexplained": "Unexplained",
}


def report_html(content: dict[str, Any]) -> str:
    """Lay out a diagnosis for people.

    Args:
        content: ``diagnosis.json``.

    Returns:
        A self-contained HTML page that prints.
    """
    parts = (
        where,
        physics,
        unexplained,
        fit,
        torque_constants,
        against,
        blind_spots,
        next_experiment,
        warnings,
    )
    title = f"Diagnosis of {content['robot']}"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{CSS}</style></head><body><main>'
        f"{_head(content, title)}{_verdict(content)}{''.join(part(content) for part in parts)}{_foot(content)}"
        "</main></body></html>\n"
    )


def _head(content: dict[str, Any], title: str) -> str:
    stamp = '<div class="simulated">SIMULATED DATA</div>' if content.get("simulated") else ""
    provenance = content.get("provenance", {})
    run, validation = provenance.get("run") or {}, provenance.get("validation") or {}
    method = content.get("estimate", {}).get("method", {})
    facts = [f"Run: {Path(run.get('path', '–')).name}"]
    facts.append(
        f"Held out: {Path(validation['path']).name}" if validation.get("path") else "No held-out recording"
    )
    facts.append(f"{content.get('model', '')} model")
    if method.get("periodic"):
        facts.append(f"{method['periods']} periods of {1 / method['fundamental_hz']:.4g} s")
    else:
        facts.append("does not repeat: no noise from replicates")
    created = content.get("estimate", {}).get("provenance", {}).get("created")
    facts += [f"made {created}"] if created else []
    line = "".join(f"<span>{escape(fact)}</span>" for fact in facts)
    return f'<div class="head"><div><h1>{escape(title)}</h1><p class="meta">{line}</p></div>{stamp}</div>'


def _verdict(content: dict[str, Any]) -> str:
    name = content["verdict"]
    return f'<div class="verdict {name}"><b>{_VERDICTS[name]}</b>{escape(headline(content))}</div>'


def _foot(content: dict[str, Any]) -> str:
    run = content.get("provenance", {}).get("run") or {}
    return (
        f"<footer>Residuum, diagnosis schema {content['schema_version']}. Run {escape(str(run.get('path', '')))}, "
        f"sha256 {escape(str(run.get('sha256', '')) or '–')}; robot description {escape(str(content['provenance'].get('robot_model_hash')))}."
        "</footer>"
    )
