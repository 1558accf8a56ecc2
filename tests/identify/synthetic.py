"""Runs made by linear algebra: a model's own rows at the samples' own instants, plus seeded noise."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from identify.dataset import Dataset, RunFacts, Signal
from identify.model import build_model
from identify.robot import Drive, ForcePlate
from tests.identify import chains
from tests.identify.robots import raw_truth, true_theta

JOINT_NOISE, WRENCH_NOISE = 1.0, np.array([3.0, 3.0, 1.5, 2.5, 2.5, 1.0])


def small_robot(seed=11, n=2):
    """Two revolute joints with drives on a tared plate."""
    drives = [
        Drive(
            gear_ratio=50.0 + 10 * k,
            torque_constant=0.2,
            rotor_inertia=1e-3,
            has_rotor=True,
            rotor_carrier=k - 1,
        )
        for k in range(n)
    ]
    description = chains.random_description(seed, n, prismatic_share=0.0, fixed=0)
    description = replace(description, gravity=np.array([0.0, 0.0, -9.81]))
    return chains.robot_of(description, ForcePlate(tared=True), drives)


@dataclass(frozen=True)
class Motion:
    """A Fourier motion, its exact derivatives included."""

    fundamental_hz: float
    offset: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray

    def __call__(self, t):
        line = np.arange(1, self.cosine.shape[1] + 1)
        w = 2 * np.pi * self.fundamental_hz * line
        c, s = np.cos(np.outer(w, t)), np.sin(np.outer(w, t))
        return (
            self.offset[:, None] + self.cosine @ c + self.sine @ s,
            (self.sine * w) @ c - (self.cosine * w) @ s,
            -(self.cosine * w**2) @ c - (self.sine * w**2) @ s,
        )


def fourier_motion(n, seed=0, fundamental_hz=0.25, harmonics=5, size=0.35):
    rng = np.random.default_rng(seed)
    return Motion(
        fundamental_hz,
        rng.normal(size=n) * 0.2,
        rng.normal(size=(n, harmonics)) * size,
        rng.normal(size=(n, harmonics)) * size,
    )


@dataclass(frozen=True)
class Clock:
    """When a stream samples: rate error, phase, jitter, losses, a gap [s]."""

    ppm: float = 0.0
    phase_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    gap: tuple = ()

    def instants(self, duration_s, rate_hz, rng):
        step = (1 + self.ppm * 1e-6) / rate_hz
        t = self.phase_s + step * np.arange(round(duration_s * rate_hz))
        t = t + self.jitter_s * np.clip(rng.normal(size=len(t)), -3, 3)
        keep = rng.random(len(t)) >= self.loss
        if self.gap:
            keep &= (t < self.gap[0]) | (t > self.gap[1])
        return t[keep]


@dataclass(frozen=True)
class Truth:
    """A noise-free run, ready to be given noise again and again."""

    model: object
    theta: np.ndarray
    scale: np.ndarray
    data: Dataset
    motion: Motion

    @property
    def constants(self):
        return np.array([j.drive.torque_constant for j in self.model.robot.joints]) / self.scale


def noise_free(
    robot=None,
    kind="combined",
    periods=8,
    rate_hz=50.0,
    motion=None,
    joint_clock=Clock(),
    plate_clock=Clock(),
    scale=(0.97, 1.04, 1.01),
    seed=0,
    **facts,
):
    """One run of whole periods; ``scale`` is nominal over true torque constant."""
    robot = robot or small_robot()
    model, rng = build_model(robot, "combined"), np.random.default_rng([seed, 99])
    motion = motion or fourier_motion(robot.n)
    theta, s = true_theta(model, raw_truth(robot)), np.array(scale[: robot.n])
    duration = periods / motion.fundamental_hz
    t, tp = joint_clock.instants(duration, rate_hz, rng), plate_clock.instants(duration, rate_hz, rng)
    drive, plate = model.drive_rows(*motion(t)), model.wrench_rows(*motion(tp))
    torque = np.einsum("cpn,p->cn", drive.columns, theta) + drive.known
    wrench = np.einsum("cpn,p->cn", plate.columns, theta) + plate.known
    factor = np.array([j.drive.gear_ratio * j.drive.torque_constant for j in robot.joints])
    stated = {
        "fundamental_hz": motion.fundamental_hz,
        "harmonics": motion.cosine.shape[1],
        "periods": periods,
    }
    data = Dataset(
        position=Signal(t, motion(t)[0]),
        current=Signal(t, torque * s[:, None] / factor[:, None]),
        effort=None,
        wrench=Signal(tp, wrench),
        facts=RunFacts(**(stated | facts)),
        kind="excitation",
        simulated=True,
        source="synthetic run",
    )
    return Truth(model, theta, s, data, motion)


def coloured(rng, std, count, ar1=0.0, correlation=0.0):
    """Stationary AR(1) noise (c, count) of given std, equally correlated between channels."""
    std = np.atleast_1d(std)
    mix = np.linalg.cholesky((1 - correlation) * np.eye(len(std)) + correlation)
    white = mix @ rng.standard_normal((len(std), count + 200))
    series = lfilter([np.sqrt(1 - ar1**2)], [1, -ar1], white, axis=1)[:, 200:]
    return std[:, None] * series


def with_noise(truth, rng, ar1=0.0, correlation=0.0, encoder=1e-6, torque=JOINT_NOISE, wrench=WRENCH_NOISE):
    """The run with fresh noise on every stream."""
    data, robot = truth.data, truth.model.robot
    factor = np.array([j.drive.gear_ratio * j.drive.torque_constant for j in robot.joints])
    size = len(data.current.t_s)
    noise = coloured(rng, np.full(robot.n, torque) * truth.scale / factor, size, ar1, correlation)
    plate = coloured(rng, wrench, len(data.wrench.t_s), ar1, correlation)
    q = data.position.values + encoder * rng.standard_normal(data.position.values.shape)
    return replace(
        data,
        position=Signal(data.position.t_s, q),
        current=Signal(data.current.t_s, data.current.values + noise),
        wrench=Signal(data.wrench.t_s, data.wrench.values + plate),
    )
