"""The campaign's report: what was right, what was missed, what was said too much; as it came out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist, median

from service.proving.score import Score, class_of

# what the diagnosis aims at, by class of trial
TARGETS = {
    "null": 0.99,
    "single, strong": 0.95,
    "single, fair": 0.85,
    "pair, strong": 0.90,
    "outside, strong": 0.90,
}


@dataclass(frozen=True)
class Row:
    """One class of trials.

    Attributes:
        name: of the class.
        trials: how many.
        right: named at its place, or among the stated alternatives there.
        exact: without alternatives.
        extra: trials with a finding that was not concealed.
        low: lower end of the 95 % interval of the share right.
        high: upper end.
        target: wanted share, None where there is none.
    """

    name: str
    trials: int
    right: int
    exact: int
    extra: int
    low: float
    high: float
    target: float | None


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927)."""
    if trials == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.975)
    share, weight = successes / trials, 1.0 + z**2 / trials
    centre = (share + z**2 / (2.0 * trials)) / weight
    half = z * (share * (1.0 - share) / trials + z**2 / (4.0 * trials**2)) ** 0.5 / weight
    return max(0.0, centre - half), min(1.0, centre + half)


def tabulate(scores: Sequence[Score]) -> list[Row]:
    """Count the trials of every class.

    Args:
        scores: of the campaign.

    Returns:
        One row a class, in alphabetical order.
    """
    rows = []
    for name in sorted({class_of(item) for item in scores}):
        members = [item for item in scores if class_of(item) == name]
        right = sum(item.right for item in members)
        low, high = wilson(right, len(members))
        rows.append(
            Row(
                name, len(members), right, sum(item.exact for item in members),
                sum(bool(item.extra) for item in members), low, high, TARGETS.get(name),
            )
        )
    return rows


def _class_table(scores: Sequence[Score]) -> list[str]:
    lines = ["| class | trials | right | 95 % interval | exact name | extra names | target |", "|---|---|---|---|---|---|---|"]
    for row in tabulate(scores):
        target = "-" if row.target is None else f"{100 * row.target:.0f} %"
        lines.append(
            f"| {row.name} | {row.trials} | {row.right} ({100 * row.right / row.trials:.0f} %) | "
            f"{100 * row.low:.0f}-{100 * row.high:.0f} % | {row.exact} | {row.extra} | {target} |"
        )
    return lines


def _effect_table(scores: Sequence[Score]) -> list[str]:
    lines = ["| effect | trials | right | strengths of the misses |", "|---|---|---|---|"]
    singles = [item for item in scores if item.kind == "single"]
    for name in sorted({item.truth[0].split("@")[0] for item in singles}):
        members = [item for item in singles if item.truth[0].split("@")[0] == name]
        missed = ", ".join(f"{item.strength:.3f}" for item in members if not item.right) or "-"
        lines.append(f"| {name} | {len(members)} | {sum(item.right for item in members)} | {missed} |")
    return lines


def _confusions(scores: Sequence[Score]) -> list[str]:
    pairs = Counter(
        (", ".join(item.truth) or "nothing", ", ".join(item.said) or f"no name ({item.verdict.replace('_', ' ')})")
        for item in scores
        if not item.right
    )
    lines = ["| concealed | said | times |", "|---|---|---|"]
    return lines + [f"| {truth} | {said} | {count} |" for (truth, said), count in pairs.most_common()]


def campaign_report(scores: Sequence[Score], failures: dict[int, str], title: str) -> str:
    """Write the report of a campaign.

    Args:
        scores: of the trials.
        failures: trials that could not be made or diagnosed, by number.
        title: what the campaign was.

    Returns:
        Markdown.
    """
    ratios = [item.gain_ratio for item in scores if item.gain_ratio is not None and item.right]
    lines = [
        f"# Blind trials: {title}",
        "",
        "All recordings are simulated by the virtual robot, whose physics shares no code with the diagnosis. Answers were sealed by",
        "their SHA-256 before the diagnosis ran in processes that never held them. A trial is *right* when every concealed effect is",
        "named at its place or stands among the alternatives stated there; *strength* is what an effect leaves after the refit of the",
        "plain model, in units of the noise std per sample: strong from 0.10, fair from 0.05, weak below.",
        "",
        *_class_table(scores),
        "",
        f"Held-out RMS over the noise floor in the trials that were right, worst channel: median {median(ratios):.3f}." if ratios else "",
        f"Time of a diagnosis: median {median(item.seconds for item in scores):.1f} s." if scores else "",
        "",
        "## By effect (single effects)",
        "",
        *_effect_table(scores),
        "",
        "## What was not right",
        "",
        *_confusions(scores),
    ]
    if failures:
        lines += ["", "## Trials that failed", "", *(f"- {number}: {problem}" for number, problem in sorted(failures.items()))]
    return "\n".join(lines) + "\n"
