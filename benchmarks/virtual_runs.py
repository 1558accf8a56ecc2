"""Runs of the virtual robot for the benchmarks: simulated once, then given fresh sensor noise."""

from dataclasses import replace
from functools import cache

import numpy as np

from daq.recording import Recording
from drivers.virtual.plant_file import NoiseSpec, PlantSpec, load_plant
from drivers.virtual.record import current_noise, record_virtual, wrench_noise
from drivers.virtual.sensors import stream_generator
from drivers.virtual.trajectories import random_fourier, random_points
from identify.dataset import Dataset
from service.datasets import dataset_of
from service.robots import LoadedRobot, load_robot

# noise per sample of Verdonck, Swevers, Samin (2001), section 6: joints [N.m], forces [N], torques [N.m]
PAPER_JOINTS, PAPER_WRENCH = (3.55, 4.03, 1.26), (10.54, 10.88, 4.81, 11.61, 11.33, 3.15)
PERIODS = 16


@cache
def robot() -> LoadedRobot:
    return load_robot("ir361")


@cache
def plant(series_spring: bool = True) -> PlantSpec:
    """The reference arm; its spring as the Fourier series of Eq. (15), so that the model is exact."""
    spec = load_plant("ir361")
    if not series_spring:
        return spec
    from drivers.virtual.plant_file import GravitySpring

    joints = list(spec.joints)
    joints[1] = joints[1].model_copy(
        update={"spring": GravitySpring(cosine_nm=(0.0, 4.0, 1.0), sine_nm=(-160.0, -18.0, 3.0))}
    )
    return spec.model_copy(update={"joints": tuple(joints)})


@cache
def excitation(seed: int = 3):
    """The best of some random excitations by the determinant of the information: rich, no optimum claimed."""
    from identify.model import build_model

    model, best, chosen = build_model(robot().robot, "combined"), -np.inf, None
    for k in range(40):
        motion = random_fourier(plant(), seed * 1000 + k)
        t = np.linspace(0.0, motion.duration_s, 300, endpoint=False)
        q = motion.position(t).T
        w = 2.0 * np.pi * motion.fundamental_hz * np.fft.fftfreq(300, 1.0 / 300)
        qd, qdd = (np.fft.ifft((1j * w) ** p * np.fft.fft(q), axis=1).real for p in (1, 2))
        rows = np.concatenate([model.drive_rows(q, qd, qdd).columns, model.wrench_rows(q, qd, qdd).columns])
        rows = rows / np.array([*PAPER_JOINTS, *PAPER_WRENCH])[:, None, None]
        flat = rows.transpose(0, 2, 1).reshape(-1, rows.shape[1])
        score = np.linalg.slogdet(flat.T @ flat)[1]
        if score > best:
            best, chosen = score, motion
    return chosen


@cache
def noise_free(
    periods: int = PERIODS, kind: str = "excitation", seed: int = 3, series_spring: bool = True
) -> Recording:
    """A run with perfect sensors but the real clocks, jitter and losses."""
    spec = plant(series_spring)
    quiet = spec.model_copy(update={"noise": spec.quiet().noise})
    trajectory = excitation(seed) if kind == "excitation" else random_points(spec, seed)
    return record_virtual(quiet, trajectory, periods, 1, seed)


def noisy_spec(ar1: float = 0.0, correlation: float = 0.0) -> PlantSpec:
    noise = NoiseSpec(
        joint_torque_nm=PAPER_JOINTS,
        wrench=PAPER_WRENCH,
        joint_ar1=ar1,
        wrench_ar1=ar1,
        joint_correlation=correlation,
        wrench_correlation=correlation,
    )
    return plant().model_copy(update={"noise": noise})


def with_noise(recording: Recording, seed: int, ar1: float = 0.0, correlation: float = 0.0) -> Recording:
    """The run with fresh noise of the virtual robot's own sensors."""
    spec = noisy_spec(ar1, correlation)
    count, plate_count = (
        int(recording.motor_currents.sequence[-1]) + 1,
        int(recording.wrench.sequence[-1]) + 1,
    )
    current = current_noise(spec, stream_generator(seed, "current noise")).next(count)[
        recording.motor_currents.sequence
    ]
    wrench = wrench_noise(spec, stream_generator(seed, "wrench noise")).next(plate_count)[
        recording.wrench.sequence
    ]
    position = recording.joint_states.data["position"]
    encoder = spec.noise.encoder_rad * stream_generator(seed, "encoder noise").standard_normal(position.shape)
    return replace(
        recording,
        joint_states=replace(recording.joint_states, data={"position": position + encoder}),
        motor_currents=replace(
            recording.motor_currents, data={"current": recording.motor_currents.data["current"] + current}
        ),
        wrench=replace(
            recording.wrench,
            data={
                "force": recording.wrench.data["force"] + wrench[:, :3],
                "torque": recording.wrench.data["torque"] + wrench[:, 3:],
            },
        ),
    )


def dataset(recording: Recording) -> Dataset:
    return dataset_of(recording, robot())
