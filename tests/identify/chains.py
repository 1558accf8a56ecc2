"""Random serial chains, described once and written both as URDF (ours) and as MJCF (the oracle's)."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from identify.robot import Drive, ForcePlate, Robot
from identify.urdf import read_urdf


@dataclass(frozen=True)
class Body:
    """One link and the joint that carries it; fixed joints have no axis."""

    kind: str  # revolute, prismatic, fixed
    xyz: np.ndarray
    rpy: np.ndarray
    axis: np.ndarray
    mass: float
    com: np.ndarray
    com_rpy: np.ndarray
    principal: np.ndarray  # moments about the centre of mass


@dataclass(frozen=True)
class Description:
    bodies: tuple
    gravity: np.ndarray


def random_description(seed, moving, prismatic_share=0.3, fixed=1):
    rng = np.random.default_rng(seed)
    kinds = ["prismatic" if rng.random() < prismatic_share else "revolute" for _ in range(moving)]
    for _ in range(fixed):
        kinds.insert(int(rng.integers(1, len(kinds) + 1)), "fixed")
    return Description(tuple(_body(rng, kind) for kind in kinds), rng.normal(size=3) * 4.0)


def _body(rng, kind):
    axis = rng.normal(size=3)
    a, b, c = rng.uniform(
        0.05, 0.4, 3
    )  # a body made of masses along three axes satisfies the triangle inequality
    return Body(
        kind,
        rng.normal(size=3) * 0.4,
        rng.uniform(-1.5, 1.5, 3),
        axis / np.linalg.norm(axis),
        float(rng.uniform(0.5, 8.0)),
        rng.normal(size=3) * 0.2,
        rng.uniform(-1.5, 1.5, 3),
        np.array([b + c, a + c, a + b]),
    )


def _text(vector):
    return " ".join(f"{x:.17g}" for x in vector)


def urdf_text(description):
    parts = ['<robot name="chain"><link name="base"/>']
    for k, b in enumerate(description.bodies):
        xx, yy, zz = (f"{moment:.17g}" for moment in b.principal)
        parts.append(
            f'<link name="l{k}"><inertial><origin xyz="{_text(b.com)}" rpy="{_text(b.com_rpy)}"/>'
            f'<mass value="{b.mass:.17g}"/>'
            f'<inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial></link>'
            f'<joint name="j{k}" type="{b.kind}"><parent link="{f"l{k - 1}" if k else "base"}"/>'
            f'<child link="l{k}"/><origin xyz="{_text(b.xyz)}" rpy="{_text(b.rpy)}"/>'
            f'<axis xyz="{_text(b.axis)}"/></joint>'
        )
    return "".join(parts) + "</robot>"


def _quat(rpy):
    x, y, z, w = Rotation.from_euler("xyz", rpy).as_quat()
    return _text((w, x, y, z))


def mjcf_text(description):
    """The same chain on a free, massless base whose six generalised forces are the base's reaction."""
    head = [_mjcf_body(k, body) for k, body in enumerate(description.bodies)]
    return (
        f'<mujoco><compiler angle="radian"/><option gravity="{_text(description.gravity)}">'
        '<flag contact="disable"/></option><worldbody><body name="base"><freejoint/>'
        '<inertial pos="0 0 0" mass="1e-12" diaginertia="1e-12 1e-12 1e-12"/>'
        + "".join(head)
        + "</body>" * len(head)
        + "</body></worldbody></mujoco>"
    )


def _mjcf_body(k, b):
    joint = {"revolute": "hinge", "prismatic": "slide"}.get(b.kind)
    return (
        f'<body name="l{k}" pos="{_text(b.xyz)}" quat="{_quat(b.rpy)}">'
        + (f'<joint name="j{k}" type="{joint}" axis="{_text(b.axis)}"/>' if joint else "")
        + f'<inertial pos="{_text(b.com)}" quat="{_quat(b.com_rpy)}" mass="{b.mass:.17g}" '
        f'diaginertia="{_text(b.principal)}"/>'
    )


def oracle_loads(description, q, qd, qdd):
    """Joint forces (n, N) and the base wrench (6, N) about its origin, by MuJoCo's inverse dynamics."""
    model = mujoco.MjModel.from_xml_string(mjcf_text(description))
    data, out = mujoco.MjData(model), []
    for k in range(q.shape[1]):
        data.qpos[:] = np.r_[np.zeros(3), 1.0, np.zeros(3), q[:, k]]
        data.qvel[:], data.qacc[:] = np.r_[np.zeros(6), qd[:, k]], np.r_[np.zeros(6), qdd[:, k]]
        mujoco.mj_inverse(model, data)
        out.append(data.qfrc_inverse.copy())
    out = np.array(out).T
    return out[6:], out[:6]


def robot_of(description, plate=None, drives=None):
    """The chain as identification sees it, with its true link parameters as the reference."""
    chain = read_urdf(urdf_text(description))
    plain = Drive(friction=(), offset=False)
    joints = tuple(
        replace(joint, drive=drives[k] if drives else plain) for k, joint in enumerate(chain.joints)
    )
    return Robot("chain", joints, description.gravity, plate, None, chain.parameters)


def random_plate(seed, tared=False):
    rng = np.random.default_rng(seed)
    return ForcePlate(Rotation.random(random_state=seed).as_matrix(), rng.normal(size=3), tared)


def random_states(seed, n, count=30):
    rng = np.random.default_rng(seed)
    return (
        rng.uniform(-1.5, 1.5, (n, count)),
        rng.normal(size=(n, count)) * 1.5,
        rng.normal(size=(n, count)) * 4.0,
    )


def smooth_motion(seed, n):
    """A motion and its exact derivatives as functions of time."""
    rng = np.random.default_rng(seed)
    amplitude, w, phase = rng.uniform(0.2, 0.8, n), rng.uniform(0.7, 2.5, n), rng.uniform(0, 6, n)

    def motion(t):
        angle = np.outer(w, t) + phase[:, None]
        a, s = amplitude[:, None], w[:, None]
        return a * np.sin(angle), a * s * np.cos(angle), -a * s**2 * np.sin(angle)

    return motion
