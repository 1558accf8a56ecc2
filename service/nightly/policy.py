"""What a night's findings lead to: nothing, a proposal, an acceptance, an alarm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from service.config import NightlySection
from service.nightly.shift import Shift
from service.nightly.trend import Trend

_GOOD_VERDICTS = ("consistent", "explained")


@dataclass(frozen=True)
class Alarm:
    """Something a person must hear of.

    Attributes:
        kind: ``failure``, ``shift``, ``drift`` or ``finding``.
        subject: what it is about; the same kind and subject on the next night is not sent again.
        sentence: for people.
    """

    kind: str
    subject: str
    sentence: str


@dataclass(frozen=True)
class Evidence:
    """What a night found.

    Attributes:
        intervals_valid: whether the model fits within noise.
        validation_ratio: largest held-out error over noise; None without a held-out recording.
        verdict: of the diagnosis; None without one.
        new_findings: sentence by finding that the night before did not have.
        shift: against the calibration in force; None where there is none.
        trends: of the torque constants.
        is_acceptable: false where data are simulated and the robot is real.
    """

    intervals_valid: bool
    validation_ratio: float | None = None
    verdict: str | None = None
    new_findings: Mapping[str, str] = field(default_factory=dict)
    shift: Shift | None = None
    trends: tuple[Trend, ...] = ()
    is_acceptable: bool = True


@dataclass(frozen=True)
class Decision:
    """What to do.

    Attributes:
        outcome: ``accept``, ``propose`` or ``keep``.
        sentence: why.
        alarms: to send.
    """

    outcome: str
    sentence: str
    alarms: tuple[Alarm, ...] = field(default=())

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "outcome": self.outcome,
            "sentence": self.sentence,
            "alarms": [vars(alarm) for alarm in self.alarms],
        }


def decide(evidence: Evidence, settings: NightlySection) -> Decision:
    """Decide on a night.

    Args:
        evidence: what it found.
        settings: policy and limits.

    Returns:
        The decision; every alarm once, the policy never accepts what moved, misfits or is simulated.
    """
    alarms = _alarms(evidence)
    doubts = _doubts(evidence, settings)
    if doubts:
        return Decision("keep", f"Nothing was proposed: {'; '.join(doubts)}.", alarms)
    why = _why_a_person(evidence, settings)
    if why:
        return Decision("propose", f"Proposed for a person to accept: {why}.", alarms)
    return Decision("accept", "Accepted by policy: it agrees with the calibration in force.", alarms)


def _alarms(evidence: Evidence) -> tuple[Alarm, ...]:
    found = [Alarm("finding", *item) for item in evidence.new_findings.items()]
    if evidence.shift is not None and evidence.shift.has_moved:
        found.append(Alarm("shift", evidence.shift.moved, evidence.shift.sentence))
    found += [Alarm("drift", trend.joint, trend.sentence) for trend in evidence.trends if trend.is_alarm]
    return tuple(found)


def _doubts(evidence: Evidence, settings: NightlySection) -> Sequence[str]:
    doubts = []
    ratio, limit = evidence.validation_ratio, settings.worst_validation_ratio
    if ratio is not None and ratio > limit:
        doubts.append(f"the held-out error is {ratio:.2f} times the noise, above {limit:g}")
    if not evidence.intervals_valid and evidence.verdict not in _GOOD_VERDICTS:
        doubts.append("the model does not fit and the diagnosis does not explain why")
    return doubts


def _why_a_person(evidence: Evidence, settings: NightlySection) -> str:
    """Why the policy does not accept by itself; empty where it does."""
    shift = evidence.shift
    reasons = (
        (not evidence.is_acceptable, "simulated results are never accepted for a real robot"),
        (settings.policy != "accept_if_consistent", "the policy is to propose"),
        (shift is None or not shift.compared, "there is no calibration in force to compare with"),
        (shift is not None and shift.has_moved, "it differs from the calibration in force"),
        (any(trend.is_alarm for trend in evidence.trends), "a torque constant drifts"),
        (bool(evidence.new_findings), "the diagnosis has a new finding"),
        (not evidence.intervals_valid, "its intervals are widened"),
        (evidence.validation_ratio is None, "no held-out recording confirms it"),
    )
    return next((text for applies, text in reasons if applies), "")
