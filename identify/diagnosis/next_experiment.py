"""What to record next: the motion that would tell rivals apart, or the cheapest look at what has no name."""

from __future__ import annotations

from identify.diagnosis.findings import Finding, Unexplained


def next_experiment(findings: tuple[Finding, ...], unexplained: Unexplained | None) -> dict[str, object] | None:
    """Propose the next recording.

    Args:
        findings: named effects with their rivals.
        unexplained: what is left without a name.

    Returns:
        Kind, effects to tell apart, a sentence and the design command's options; None where nothing is open.
    """
    open_ones = [item for item in findings if item.alternatives]
    if open_ones:
        return _discriminating(max(open_ones, key=lambda item: item.delta_chi2))
    if unexplained is not None:
        return _look_again(unexplained)
    return None


def _discriminating(item: Finding) -> dict[str, object]:
    place = item.joint or item.channel or "robot"
    rivals = [item.effect, *item.alternatives]
    options = " ".join(f"--effect {name}:{place}" for name in rivals)
    return {
        "kind": "discriminating_excitation",
        "effects": rivals,
        "place": place,
        "options": f"--criterion discriminating {options}",
        "sentence": (
            f"These data cannot tell {item.effect} at {place} from {', '.join(item.alternatives)}: record the excitation that "
            f"separates them best (residuum design with --criterion discriminating {options})."
        ),
    }


def _look_again(rest: Unexplained) -> dict[str, object]:
    return {
        "kind": "companions",
        "effects": [],
        "place": ", ".join(rest.channels),
        "options": "--twin twin.json --slow slow.json",
        "sentence": (
            f"What is left in {', '.join(rest.channels)} has no name yet: record the same path in reversed time (friction and timing "
            "change sign, springs and geometry do not) and four times slower (inertia fades, friction stays)."
        ),
    }
