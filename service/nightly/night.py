"""One night: check, measure or take recordings, identify, diagnose, compare, decide, keep the account."""

from __future__ import annotations

import time
import uuid
from dataclasses import dataclass, field
from typing import Any

from service.config import NightlySection
from service.errors import ServiceError
from service.nightly.client import Client, RemoteRefusal
from service.nightly.policy import Alarm, Decision, Evidence, decide
from service.nightly.shift import GroupShift, Shift
from service.nightly.trend import Trend
from service.refusals import Refusal

_LOOK_S = 0.5  # between two looks at a job
_LEASE_MIN = 240.0
_OVER = ("done", "failed", "cancelled", "interrupted")


class NightFailed(Refusal):
    """A step of the night did not succeed."""

    code = "night_failed"


@dataclass(frozen=True)
class NightPlan:
    """What a night is to do.

    Attributes:
        robot: serial.
        recording: identifier of the recording to identify; None records the robot.
        validation: identifier of a held-out recording, or None.
        excitation: identifier of the motion to record.
    """

    robot: str
    recording: str | None = None
    validation: str | None = None
    excitation: str | None = None


@dataclass(frozen=True)
class NightReport:
    """What a night did.

    Attributes:
        outcome: accepted, proposed, kept, skipped or failed.
        sentence: why.
        estimate_id: of the night, None where there is none.
        diagnosis_id: likewise.
        alarms: everything found.
        fresh: those that the night before had not; these are sent.
    """

    outcome: str
    sentence: str
    estimate_id: str | None = None
    diagnosis_id: str | None = None
    alarms: tuple[Alarm, ...] = ()
    fresh: tuple[Alarm, ...] = field(default=())


class Night:
    """Carries out a night over the REST API.

    Args:
        client: the server.
        settings: policy, levels, patience.
    """

    def __init__(self, client: Client, settings: NightlySection) -> None:
        self._client, self._settings = client, settings
        self._key = uuid.uuid4().hex

    def run(self, plan: NightPlan) -> NightReport:
        """Run the night; whatever happens, its account is kept on the server when that answers.

        Raises:
            ServerAway: the server does not answer.
            RemoteRefusal: it does not know the robot, or does not take the account.
        """
        robot = self._get(f"/v1/robots/{plan.robot}")
        last = self._last_night(plan.robot)
        busy = self._why_not(plan, robot)
        report = NightReport("skipped", busy) if busy else self._leased(plan, robot, last)
        known = {
            (alarm["kind"], alarm["subject"]) for alarm in (last or {}).get("content", {}).get("alarms", [])
        }
        fresh = tuple(alarm for alarm in report.alarms if (alarm.kind, alarm.subject) not in known)
        self._keep(plan, report)
        return NightReport(**(vars(report) | {"fresh": fresh}))

    def _leased(self, plan: NightPlan, robot: dict[str, Any], last: dict[str, Any] | None) -> NightReport:
        try:
            self._post(
                f"/v1/robots/{plan.robot}/lease",
                {"minutes": _LEASE_MIN, "purpose": "nightly recalibration"},
                "lease",
            )
        except RemoteRefusal as error:
            if error.code == "lease_held":  # somebody was faster
                return NightReport("skipped", str(error))
            raise
        try:
            return self._measured(plan, robot, last)
        except ServiceError as error:
            return NightReport(
                "failed", str(error), alarms=(Alarm("failure", getattr(error, "code", "error"), str(error)),)
            )
        finally:
            self._client.call("DELETE", f"/v1/robots/{plan.robot}/lease")

    def _why_not(self, plan: NightPlan, robot: dict[str, Any]) -> str:
        if plan.recording is None and not robot["unattended"]:
            return f"Robot {robot['serial']} is not cleared for unattended motion; the night was skipped."
        me = self._get("/v1/me")["name"]
        lease = robot["lease"]
        if lease is not None and lease["owner"] != me:
            until = f"'{lease['owner']}' until {lease['expires_at']}"
            return f"Robot {robot['serial']} is leased to {until}; the night was skipped."
        return ""

    def _measured(self, plan: NightPlan, robot: dict[str, Any], last: dict[str, Any] | None) -> NightReport:
        if plan.recording is None:
            plan = self._recorded(plan, robot)
        body = {"recording_id": plan.recording, "validation_id": plan.validation}
        fit = self._post("/v1/fits", body, "fit")
        asked = self._post("/v1/diagnoses", body, "diagnosis")
        estimate_id = self._finished(f"/v1/fits/{fit['id']}")["estimate_id"]
        diagnosis = self._finished(f"/v1/diagnoses/{asked['id']}")
        evidence = self._evidence(robot, estimate_id, diagnosis, last)
        decision = decide(evidence, self._settings)
        outcome = self._apply(decision, estimate_id)
        return NightReport(outcome, decision.sentence, estimate_id, diagnosis["id"], decision.alarms)

    def _recorded(self, plan: NightPlan, robot: dict[str, Any]) -> NightPlan:
        """Move the robot: warm-up, run, validation motion."""
        warm_up = self._settings.warm_up_periods
        if warm_up:
            self._run(plan, robot, "warm-up", {"periods": warm_up})
        run = self._run(plan, robot, "run", {"periods": self._settings.periods})
        held_out = self._run(plan, robot, "validation", {"is_validation": True, "seed": 1})
        return NightPlan(plan.robot, run, held_out)

    def _run(self, plan: NightPlan, robot: dict[str, Any], step: str, options: dict[str, Any]) -> str:
        body = {"robot_serial": plan.robot, "excitation_id": plan.excitation, "unattended": True, **options}
        made = self._post("/v1/runs", body, step)
        self._post(f"/v1/runs/{made['id']}/confirm", {"robot_name": robot["name"]}, f"{step}-confirm")
        deadline_s = time.monotonic() + self._settings.wait_s
        while time.monotonic() < deadline_s:
            found = self._get(f"/v1/runs/{made['id']}")
            if found["state"] == "finished":
                return str(found["recording_id"])
            if found["state"] in ("failed", "aborted", "interrupted"):
                error = found["error"] or {"cause": f"it was {found['state']}", "remedy": "look at the robot"}
                raise NightFailed(f"The {step} did not succeed: {error['cause']}", error["remedy"])
            time.sleep(_LOOK_S)
        self._client.call("POST", f"/v1/runs/{made['id']}/abort")
        raise NightFailed(
            f"The {step} took longer than {self._settings.wait_s:g} s",
            "look at the robot; raise nightly.wait_s",
        )

    def _evidence(
        self, robot: dict[str, Any], estimate_id: str, diagnosis: dict[str, Any], last: dict[str, Any] | None
    ) -> Evidence:
        estimate = self._get(f"/v1/estimates/{estimate_id}/estimate.json")
        history = self._get(f"/v1/robots/{robot['serial']}/torque-constants")
        return Evidence(
            intervals_valid=bool(estimate["intervals_valid"]),
            validation_ratio=validation_ratio(estimate),
            verdict=diagnosis["verdict"],
            new_findings=self._new_findings(diagnosis["id"], last),
            shift=self._shift(robot["serial"], estimate_id),
            trends=tuple(Trend(**entry) for entry in history["trends"]),
            is_acceptable=robot["simulated"] or not estimate["simulated"],
        )

    def _shift(self, serial: str, estimate_id: str) -> Shift | None:
        force = self._get(f"/v1/robots/{serial}/calibration")
        if force is None:
            return None
        found = self._get(f"/v1/comparisons?first={force['estimate_id']}&second={estimate_id}")
        return Shift(**(found | {"groups": tuple(GroupShift(**group) for group in found["groups"])}))

    def _new_findings(self, diagnosis_id: str, last: dict[str, Any] | None) -> dict[str, str]:
        before = (last or {}).get("content", {}).get("diagnosis_id")
        known = self._findings(before) if before else {}
        return {key: sentence for key, sentence in self._findings(diagnosis_id).items() if key not in known}

    def _findings(self, diagnosis_id: str) -> dict[str, str]:
        found = self._get(f"/v1/diagnoses/{diagnosis_id}/diagnosis.json")
        named = {
            f"{f['effect']} {f['joint'] or f['channel'] or ''}".strip(): f["sentence"]
            for f in found["findings"]
        }
        rest = found["unexplained"]
        return named | ({"unexplained": rest["sentence"]} if rest else {})

    def _apply(self, decision: Decision, estimate_id: str) -> str:
        if decision.outcome == "keep":
            return "kept"
        made = self._post(
            "/v1/calibrations", {"estimate_id": estimate_id, "reason": decision.sentence}, "proposal"
        )
        if decision.outcome == "propose":
            return "proposed"
        self._post(f"/v1/calibrations/{made['id']}/accept", {"reason": decision.sentence}, "acceptance")
        return "accepted"

    def _finished(self, path: str) -> dict[str, Any]:
        deadline_s = time.monotonic() + self._settings.wait_s
        while time.monotonic() < deadline_s:
            found = self._get(path)
            if found["job"]["state"] == "done":
                return found
            if found["job"]["state"] in _OVER:
                error = found["job"]["error"] or {
                    "cause": f"The job was {found['job']['state']}",
                    "remedy": "look at the server's jobs",
                }
                raise NightFailed(f"{path} did not succeed: {error['cause']}", error["remedy"])
            time.sleep(_LOOK_S)
        raise NightFailed(
            f"{path} took longer than {self._settings.wait_s:g} s",
            "raise nightly.wait_s or use a faster machine",
        )

    def _last_night(self, serial: str) -> dict[str, Any] | None:
        """The last night that came to an end with a diagnosis: skipped ones say nothing of the robot."""
        nights = self._get(f"/v1/nights?robot={serial}&limit=50")["items"]
        return next((night for night in nights if night["content"].get("diagnosis_id")), None)

    def _keep(self, plan: NightPlan, report: NightReport) -> None:
        body = {
            "robot_serial": plan.robot, "outcome": report.outcome, "sentence": report.sentence[:4000],
            "estimate_id": report.estimate_id, "diagnosis_id": report.diagnosis_id,
            "alarms": [{key: value[:500] for key, value in vars(alarm).items()} for alarm in report.alarms],
        }  # fmt: skip
        self._post("/v1/nights", body, "account")

    def _get(self, path: str) -> Any:
        return self._client.call("GET", path)

    def _post(self, path: str, body: dict[str, Any], step: str) -> Any:
        return self._client.call("POST", path, body, f"night-{self._key}-{step}")


def validation_ratio(estimate: dict[str, Any]) -> float | None:
    """Largest held-out error over noise of any channel; None without a held-out recording."""
    channels = estimate.get("validation", {}).get("channels", {})
    ratios = [c["rms"] / c["noise"] for c in channels.values() if c["rms"] is not None and c["noise"]]
    return max(ratios) if ratios else None
