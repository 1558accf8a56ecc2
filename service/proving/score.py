"""Score a diagnosis against the answer that was concealed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

# names under which a concealed parameter appears in a finding, where the plant calls it otherwise
_STRONG, _FAIR = 0.10, 0.05  # of the noise std, left after the refit: the classes of the targets


@dataclass(frozen=True)
class Score:
    """One trial scored.

    Attributes:
        number: of the trial.
        kind: what kind of trial.
        truth: concealed effects as ``name@place``.
        said: findings as ``name@place``.
        verdict: of the diagnosis.
        strength: what the weakest concealed effect leaves after the refit, in noise std.
        right: every concealed effect named at its place, or among the alternatives stated there.
        exact: the same without alternatives.
        extra: findings that are no concealed effect.
        gain_ratio: held-out RMS after, over the noise, worst channel.
        seconds: time of the diagnosis.
    """

    number: int
    kind: str
    truth: tuple[str, ...]
    said: tuple[str, ...]
    verdict: str
    strength: float
    right: bool
    exact: bool
    extra: tuple[str, ...]
    gain_ratio: float | None
    seconds: float


def _place(effect: Mapping[str, Any]) -> str:
    return effect.get("joint") or effect.get("channel") or "robot"


def _matches(truth: Mapping[str, Any], finding: Mapping[str, Any], alternatives: bool) -> bool:
    names = [finding["effect"], *(finding["alternatives"] if alternatives else [])]
    if truth["name"] not in names:
        return False
    if finding["effect"] != truth["name"]:
        # an alternative stands for the same channels; effects of the whole robot or plate have no joint
        return truth.get("joint") in (None, finding["joint"]) or finding["joint"] is None
    return truth.get("joint") in (None, finding["joint"]) and truth.get("channel") in (None, finding["channel"])


def score(answer: Mapping[str, Any], diagnosis: Mapping[str, Any], seconds: float) -> Score:
    """Compare an opened answer with a diagnosis.

    Args:
        answer: scenario and strength.
        diagnosis: ``diagnosis.json``.
        seconds: time the diagnosis took.

    Returns:
        The score.
    """
    scenario = answer["scenario"]
    catalogued = scenario["effects"] if scenario["kind"] != "outside" else []
    findings = diagnosis["findings"]
    exact = all(any(_matches(effect, item, False) for item in findings) for effect in catalogued)
    right = all(any(_matches(effect, item, True) for item in findings) for effect in catalogued)
    extra = [item for item in findings if not any(_matches(effect, item, True) for effect in catalogued)]
    if scenario["kind"] == "null":
        right = exact = diagnosis["verdict"] == "consistent"
    if scenario["kind"] == "outside":
        right = exact = not findings and diagnosis["verdict"] == "unexplained"
    validation = diagnosis["fit"]["validation"]
    ratios = [validation["after"][c] / validation["noise"][c] for c in validation["after"] if validation["noise"].get(c)]
    return Score(
        scenario["number"],
        scenario["kind"],
        tuple(f"{effect['name']}@{_place(effect)}" for effect in scenario["effects"]),
        tuple(f"{item['effect']}@{item['joint'] or item['channel'] or 'robot'}" for item in findings),
        diagnosis["verdict"],
        min(answer["strength"], default=0.0),
        right,
        exact,
        tuple(f"{item['effect']}@{item['joint'] or item['channel'] or 'robot'}" for item in extra),
        max(ratios) if ratios else None,
        seconds,
    )


def class_of(item: Score) -> str:
    """Class of a trial in the report: what it leaves after the refit against the noise."""
    if item.kind == "null":
        return "null"
    size = "strong" if item.strength >= _STRONG else "fair" if item.strength >= _FAIR else "weak"
    return f"{item.kind}, {size}"
