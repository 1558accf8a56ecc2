"""A robot and an excitation become a recording: the one path behind command line and service."""

from __future__ import annotations

import os
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.acquisition import Acquisition, Job
from daq.errors import UsageError as DaqUsageError
from daq.excitation import Excitation, excitation_of
from daq.limits import Limits
from daq.mcap_writer import PARTIAL_SUFFIX
from daq.preflight import Check, DryRun, dry_run
from daq.run_report import RunReport
from daq.run_state import Change, RunState, RunStatus
from daq.trajectory import Plan, plan_excitation, plan_motion, plan_validation
from drivers.virtual.effects.effect import EffectSpec
from service.benches import DEFAULT_RATE_HZ, Bench, limits_for, real_bench, software_version, virtual_bench
from service.errors import RunAbortedError, RunFailedError, UsageError
from service.files import read_json
from service.robots import LoadedRobot, load_robot

Planner = Callable[[np.ndarray, float], Plan]


@dataclass(frozen=True)
class RecordRequest:
    """What somebody wants recorded.

    Attributes:
        robot: preset name or path.
        excitation: path of the motion's file.
        output: path of the log.
        is_virtual: record the virtual robot.
        is_real_time: let the virtual robot live in real time.
        periods: measured periods.
        transient_periods: periods before them.
        is_validation: move from point to point through the box that the excitation explores.
        points: of the validation motion.
        seed: of the virtual robot's noise and of the validation points.
        effects: on top of the virtual robot.
        rate_hz: SYNC rate; the excitation's, else the robot file's, else 150 Hz.
        run_id: identifies the run; made up where not given.
    """

    robot: str
    excitation: Path
    output: Path
    is_virtual: bool = False
    is_real_time: bool = False
    periods: int = 16
    transient_periods: int = 1
    is_validation: bool = False
    points: int = 12
    seed: int = 0
    effects: tuple[EffectSpec, ...] = ()
    rate_hz: float | None = None
    run_id: str | None = None


@dataclass(frozen=True)
class Motion:
    """A motion read from a file: how it is planned, and at which rate it was designed.

    Attributes:
        plan: from where the arm stands (k,) and the bus period [s] to set points.
        rate_hz: of the design, None where it does not say.
        text: the file, for the log.
    """

    plan: Planner
    rate_hz: float | None
    text: str


@dataclass(frozen=True)
class Session:
    """A run that is ready to start."""

    request: RecordRequest
    loaded: LoadedRobot
    limits: Limits
    motion: Motion
    rate_hz: float
    bench: Bench
    acquisition: Acquisition

    def run(self) -> RunReport:
        """Record.

        Raises:
            RunFailedError, RunAbortedError: it did not complete; both carry the report.
        """
        try:
            report = self.acquisition.execute()
        finally:
            self.bench.close()
        if report.state is RunState.ABORTED:
            raise RunAbortedError(report.sentence, report)
        if report.state is not RunState.RECORDED:
            raise RunFailedError(report.sentence, report, _exit_code(self.acquisition, report))
        return report


def _exit_code(acquisition: Acquisition, report: RunReport) -> int:
    """A refusal before anything moved keeps its own code; whatever stopped a motion is hardware."""
    return 3 if report.cycles else int(getattr(acquisition.error, "exit_code", 3) or 3)


def read_motion(request: RecordRequest, limits: Limits) -> Motion:
    """Read an excitation, or a file of moves (validation, poses, sweeps).

    Raises:
        UsageError: the file does not fit.
    """
    content = read_json(request.excitation, "the excitation")
    text = Path(request.excitation).read_text("utf-8")
    if "points" in content:
        return _moves_motion(content, limits, str(request.excitation), text)
    excitation = excitation_of(content, str(request.excitation), text).ordered(limits.joints)
    if request.is_validation:
        return Motion(_validation_planner(request, excitation, limits), excitation.sample_rate_hz, text)

    def plan(start: np.ndarray, period_s: float) -> Plan:
        return plan_excitation(
            excitation, limits, start, period_s, request.periods, request.transient_periods
        )

    return Motion(plan, excitation.sample_rate_hz, text)


def _validation_planner(request: RecordRequest, excitation: Excitation, limits: Limits) -> Planner:
    orbit = excitation.evaluate(np.linspace(0.0, excitation.period_s, 2048))[0]
    low, high = np.maximum(orbit.min(axis=0), limits.lower), np.minimum(orbit.max(axis=0), limits.upper)

    def plan(start: np.ndarray, period_s: float) -> Plan:
        return plan_validation(limits, start, period_s, low, high, request.points, request.seed)

    return plan


def _moves_motion(content: Mapping[str, object], limits: Limits, where: str, text: str) -> Motion:
    from identify.excitation.companions import Moves

    try:
        joints = [str(name) for name in content["joints"]]  # type: ignore[attr-defined]
        order = [joints.index(name) for name in limits.joints]
        points = np.array(content["points"], dtype=float)[:, order]
        durations, blends = (np.array(content[key], dtype=float) for key in ("duration_s", "blend_s"))
        moves = Moves(points, durations, blends, float(content["pause_s"]))  # type: ignore[arg-type]
        rate = content.get("sample_rate_hz")
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise UsageError(
            f"The moves {where} lack or garble {error}; write them anew with residuum design."
        ) from error

    def evaluate(t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        q, qd, qdd = moves.evaluate(t_s)
        return q.T, qd.T, qdd.T

    kind = "validation" if content.get("kind") == "validation" else "free"

    def plan(start: np.ndarray, period_s: float) -> Plan:
        return plan_motion(limits, start, period_s, evaluate, moves.total_s, kind)

    return Motion(plan, float(rate) if isinstance(rate, int | float) else None, text)


def open_session(request: RecordRequest, listeners: Sequence[Callable[[Change], None]] = ()) -> Session:
    """Read everything, check it, and open the bench; nothing moves yet.

    Raises:
        UsageError, daq.errors.DaqError, drivers.errors.DriverError: each one sentence with its remedy.
    """
    loaded = load_robot(request.robot)
    limits = limits_for(loaded)
    _check_request(request)
    motion = read_motion(request, limits)
    stated_hz = loaded.file.bus.rate_hz if loaded.file.bus is not None else None
    rate_hz = request.rate_hz or stated_hz or motion.rate_hz or DEFAULT_RATE_HZ
    _check_output(request.output)
    bench = _bench(request, loaded, rate_hz)
    job = Job(
        path=request.output, plan=_foreseen(motion.plan, bench), limits=limits,
        metadata=_metadata(request, loaded),
        attachments=_attachments(loaded, motion), patient=bench.is_virtual and not request.is_real_time,
        checks=lambda: _checks(bench),
    )
    acquisition = Acquisition(job, bench.drives, bench.clock, bench.plate, RunStatus(*listeners))
    return Session(request, loaded, limits, motion, rate_hz, bench, acquisition)


def _foreseen(planner: Planner, bench: Bench) -> Planner:
    """The planner, which also tells a simulated bench what is coming."""

    def plan(start: np.ndarray, period_s: float) -> Plan:
        made = planner(start, period_s)
        bench.foresee(made.q)
        return made

    return plan


def preview(request: RecordRequest, start: np.ndarray | None = None) -> tuple[Plan, DryRun]:
    """What a run would do, from zero pose or `start` (k,), without touching any hardware."""
    loaded = load_robot(request.robot)
    limits = limits_for(loaded)
    _check_request(request)
    motion = read_motion(request, limits)
    rate_hz = request.rate_hz or motion.rate_hz or DEFAULT_RATE_HZ
    begin = np.clip(np.zeros(len(limits.joints)), limits.lower, limits.upper) if start is None else start
    plan = motion.plan(begin, 1.0 / rate_hz)
    return plan, dry_run(plan, limits, loaded.file.force_plate is not None)


def _bench(request: RecordRequest, loaded: LoadedRobot, rate_hz: float) -> Bench:
    if not request.is_virtual:
        return real_bench(loaded, rate_hz)
    if request.is_real_time:
        from service.live_benches import live_bench

        return live_bench(loaded, rate_hz, request.seed, request.effects)
    return virtual_bench(loaded, rate_hz, request.seed, request.effects)


def _check_request(request: RecordRequest) -> None:
    if request.is_real_time and not request.is_virtual:
        raise UsageError("--real-time is about the virtual robot; add --virtual, or leave it out.")
    if request.effects and not request.is_virtual:
        raise UsageError("--effect changes the virtual robot; add --virtual, or leave it out.")
    if request.periods < 1 or request.transient_periods < 0 or request.points < 1:
        raise UsageError(
            f"{request.periods} periods after {request.transient_periods} transient ones and "
            f"{request.points} points cannot be recorded; give at least one period and one point, and no "
            "negative numbers."
        )


def _check_output(path: Path) -> None:
    partial = path.with_name(path.name + PARTIAL_SUFFIX)
    if partial.exists():
        raise DaqUsageError(
            f"{partial} exists: an unfinished log lies there; `residuum recover {partial} -o whole.mcap` "
            "saves it; then delete it."
        )


def _checks(bench: Bench) -> tuple[Check, ...]:
    if bench.is_virtual:
        return ()
    from service.doctor import realtime_checks

    return realtime_checks()


def _metadata(request: RecordRequest, loaded: LoadedRobot) -> dict[str, str]:
    made_up = f"{time.strftime('%Y%m%dT%H%M%S')}-{uuid.uuid4().hex[:8]}"
    if request.is_virtual and not request.is_real_time:
        made_up = f"virtual-{loaded.name}-{request.seed}"  # the same seed gives the same bytes
    table = {
        "schema_version": "1",
        "run_id": request.run_id or made_up,
        "robot": loaded.name,
        "robot_model": loaded.model_hash,
        "simulated": "true" if request.is_virtual else "false",
        "software": software_version(),
    }
    if loaded.file.serial:
        table["robot_serial"] = loaded.file.serial
    if request.is_virtual:
        table["seed"] = str(request.seed)
    if request.effects:
        table["effects"] = "; ".join(_effect_text(effect) for effect in request.effects)
    return table


def _effect_text(effect: EffectSpec) -> str:
    sizes = ", ".join(f"{key} {value:g}" for key, value in effect.parameters.items())
    return f"{effect.name} {effect.joint or effect.channel or ''} {sizes}".strip()


def _attachments(loaded: LoadedRobot, motion: Motion) -> dict[str, bytes]:
    return {
        "robot.toml": loaded.toml_text.encode(),
        os.path.basename(loaded.file.urdf): loaded.urdf_text.encode(),
        "excitation.json": motion.text.encode(),
    }
