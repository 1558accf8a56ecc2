"""A whole run of the virtual robot as a recording: own clocks, noise, lost samples, marked simulated."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq.recording import Recording, Stream
from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.errors import PlantError
from drivers.virtual.plant import VirtualPlant
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.sensors import ColouredNoise, current_noise_std_a, quantise, stream_generator
from drivers.virtual.trajectories import FourierMotion, Trajectory

EPOCH_NS = 1_760_000_000_000_000_000  # October 2025
_LEAD_S = 2.0  # motion before the first sample, so that the loops have settled


@dataclass(frozen=True)
class _Clock:
    """Samples of one stream: true instants, and what the log says of them."""

    t_s: np.ndarray
    stamp_ns: np.ndarray
    log_time_ns: np.ndarray
    kept: np.ndarray


def record_virtual(
    plant: PlantSpec,
    trajectory: Trajectory,
    periods: int = 16,
    transient_periods: int = 1,
    seed: int = 0,
    effects: Sequence[EffectSpec] = (),
    kind: str | None = None,
    start_ns: int = EPOCH_NS,
    attachments: Mapping[str, bytes] | None = None,
) -> Recording:
    """Record the virtual robot on a trajectory: periodic for a `FourierMotion`, else once through.

    Args:
        plant: the plant.
        trajectory: setpoints as a function of time.
        periods: measured periods of a periodic trajectory.
        transient_periods: periods before them, recorded too.
        seed: of all noise; the same seed gives the same bytes.
        effects: effects on top of the plant.
        kind: `excitation`, `validation` or `free`; from the trajectory where not given.
        start_ns: stamp of the run's start.
        attachments: files to carry along.

    Returns:
        The recording, marked simulated.

    Raises:
        PlantError: The plant or an effect cannot be simulated.
    """
    periodic = isinstance(trajectory, FourierMotion)
    duration_s = trajectory.duration_s * ((periods + transient_periods) if periodic else 1)
    virtual = run_motion(plant, trajectory, duration_s, effects)
    joint_clock = _joint_clock(plant, duration_s, seed, start_ns)
    metadata = _metadata(plant, trajectory, kind or ("excitation" if periodic else "validation"), seed)
    if periodic:
        metadata |= {"periods": str(periods), "transient_periods": str(transient_periods)}
    return Recording(
        source=f"virtual:{plant.name}",
        joint_states=_joint_stream(virtual, joint_clock, seed),
        motor_currents=_current_stream(virtual, joint_clock, seed),
        wrench=None if plant.plate is None else _wrench_stream(virtual, duration_s, seed, start_ns),
        setpoints=_setpoint_stream(virtual, trajectory, joint_clock),
        metadata=metadata,
        attachments=dict(attachments or {}),
        sha256=hashlib.sha256(repr((plant, effects, seed, metadata)).encode()).hexdigest(),
        warnings=(),
    )


def run_motion(
    plant: PlantSpec, trajectory: Trajectory, duration_s: float, effects: Sequence[EffectSpec] = ()
) -> VirtualPlant:
    """Move a fresh plant through the whole trajectory, from before zero to after the end."""
    lead_s, tail_s = _LEAD_S, 0.1
    start = trajectory.position(np.array([-lead_s]))[0]
    virtual = VirtualPlant(plant, effects, start, -lead_s, keep_s=duration_s + lead_s + 1.0)
    count = int(np.ceil((duration_s + lead_s + tail_s) / virtual.period_s))
    virtual.follow(trajectory.position(-lead_s + virtual.period_s * np.arange(1, count + 1)))
    return virtual


def _metadata(plant: PlantSpec, trajectory: Trajectory, kind: str, seed: int) -> dict[str, str]:
    if kind not in ("excitation", "validation", "free"):
        raise PlantError(f"A run is of kind excitation, validation or free, not {kind}.")
    table = {
        "schema_version": "1",
        "run_id": f"virtual-{plant.name}-{seed}",
        "robot": plant.name,
        "kind": kind,
        "simulated": "true",
        "sample_rate_hz": f"{plant.sampling.rate_hz:g}",
    }
    if isinstance(trajectory, FourierMotion):
        table |= {
            "fundamental_hz": f"{trajectory.fundamental_hz:.12g}",
            "harmonics": str(trajectory.harmonics),
        }
    return table


def _clock(plant: PlantSpec, grid_s: np.ndarray, random: np.random.Generator, start_ns: int) -> _Clock:
    sampling = plant.sampling
    count = len(grid_s)
    t_s = grid_s + sampling.interval_jitter_s * np.clip(random.standard_normal(count), -5.0, 5.0)
    claimed_s = t_s + sampling.stamp_error_s * random.standard_normal(count)
    late_s = sampling.latency_s + np.abs(random.standard_normal(count)) * sampling.latency_jitter_s
    kept = random.random(count) >= sampling.loss_rate
    stamp_ns = start_ns + np.rint(claimed_s * 1e9).astype(np.int64)
    log_time_ns = np.maximum.accumulate(stamp_ns + np.rint(late_s * 1e9).astype(np.int64))
    return _Clock(t_s, stamp_ns, log_time_ns, kept)


def _joint_clock(plant: PlantSpec, duration_s: float, seed: int, start_ns: int) -> _Clock:
    rate_hz = plant.sampling.rate_hz
    grid_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    return _clock(plant, grid_s, stream_generator(seed, "joint clock"), start_ns)


def _stream(
    topic: str, schema: str, names: tuple[str, ...], frame: str, clock: _Clock, data: dict[str, np.ndarray]
) -> Stream:
    kept = clock.kept
    return Stream(
        topic=topic,
        schema=schema,
        names=names,
        frame_id=frame,
        stamp_ns=clock.stamp_ns[kept],
        log_time_ns=clock.log_time_ns[kept],
        sequence=np.flatnonzero(kept).astype(np.uint32),
        data={key: values[kept] for key, values in data.items()},
    )


def _joint_stream(virtual: VirtualPlant, clock: _Clock, seed: int) -> Stream:
    noise, random = virtual.spec.noise, stream_generator(seed, "encoder noise")
    true = virtual.encoders(clock.t_s)
    reading = quantise(
        true + noise.encoder_rad * random.standard_normal(true.shape), noise.encoder_resolution_rad
    )
    names = virtual.spec.joint_names
    return _stream(
        "/joint_states", "sensor_msgs/msg/JointState", names, "base_link", clock, {"position": reading}
    )


def _current_stream(virtual: VirtualPlant, clock: _Clock, seed: int) -> Stream:
    spec = virtual.nominal
    noise = current_noise(spec, stream_generator(seed, "current noise"))
    current = virtual.currents(clock.t_s) + noise.next(len(clock.t_s))
    current = quantise(current, spec.noise.current_resolution_a)
    names = spec.joint_names
    return _stream(
        "/motor_currents", "residuum_msgs/msg/MotorCurrents", names, "", clock, {"current": current}
    )


def _wrench_stream(virtual: VirtualPlant, duration_s: float, seed: int, start_ns: int) -> Stream:
    spec, plate = virtual.spec, virtual.spec.plate
    assert plate is not None
    step_s = 1.0 / (spec.sampling.rate_hz * (1.0 + 1e-6 * plate.clock_ppm))
    count = int((duration_s - plate.clock_phase_s) / step_s) + 1
    grid_s = plate.clock_phase_s + step_s * np.arange(count)
    clock = _clock(spec, grid_s, stream_generator(seed, "plate clock"), start_ns)
    noise = wrench_noise(spec, stream_generator(seed, "wrench noise"))
    wrench = quantise(virtual.wrench(clock.t_s) + noise.next(count), spec.noise.wrench_resolution)
    data = {"force": wrench[:, :3], "torque": wrench[:, 3:]}
    return _stream("/force_plate/wrench", "geometry_msgs/msg/WrenchStamped", (), "force_plate", clock, data)


def _setpoint_stream(virtual: VirtualPlant, trajectory: Trajectory, clock: _Clock) -> Stream:
    data = {"position": trajectory.position(clock.t_s)}
    names = virtual.spec.joint_names
    return _stream("/joint_setpoints", "sensor_msgs/msg/JointState", names, "base_link", clock, data)


def current_noise(spec: PlantSpec, random: np.random.Generator) -> ColouredNoise:
    """Noise of the motor currents [A]."""
    gear = np.array([joint.gear_ratio for joint in spec.joints])
    constant = np.array([joint.torque_constant_nm_a for joint in spec.joints])
    torque_nm = spec.noise.joint_torque_nm or (0.0,) * len(gear)
    std_a = current_noise_std_a(torque_nm, gear, constant)
    return ColouredNoise(std_a, spec.noise.joint_ar1, spec.noise.joint_correlation, random)


def wrench_noise(spec: PlantSpec, random: np.random.Generator) -> ColouredNoise:
    """Noise of the six plate channels [N, N.m]."""
    noise = spec.noise
    return ColouredNoise(np.array(noise.wrench), noise.wrench_ar1, noise.wrench_correlation, random)
