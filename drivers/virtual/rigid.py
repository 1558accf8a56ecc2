"""Rigid-body dynamics of arm and rotors by MuJoCo: what joints and plate must supply for a motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np

from drivers.virtual.errors import PlantError
from drivers.virtual.plant_file import LinkInertial, PlantSpec
from drivers.virtual.urdf_tree import MOVING, Tree, TreeJoint, read_tree, rotation_from_rpy

_ROTOR_MASS_KG = 1e-9  # a rotor's mass is part of its link's inertial; MuJoCo only wants it positive
_BASE_DOF = 6


class OutsideForce(Protocol):
    """A force from the world on one link; it needs where the link is."""

    link: str
    point_m: np.ndarray
    """(3,) point of attack in the link's frame."""

    def __call__(self, index: int, position_m: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force (3,) and torque (3,) in the base frame at moment `index`; `axes` (3, 3) turns the link."""
        ...


@dataclass(frozen=True)
class RigidLoads:
    """What a motion costs: joint torques (n, k), wrench of the plate on the robot (n, 6), bearing moments."""

    joint_nm: np.ndarray
    link_nm: np.ndarray
    """(n, k) the share of the links alone, without their rotors: what the gear transmits."""
    wrench: np.ndarray
    tilting_nm: np.ndarray | None = None
    """(n, k) moment across each joint's bearing, perpendicular to its axis; None when not asked for."""


class RigidPlant:
    """Arm, base and spinning rotors as one MuJoCo model on a base whose six reactions are read.

    The base hangs on a free joint held at rest, so that inverse dynamics returns the base's reaction together
    with the joint torques. Every rotor is a body of its own that spins on `rotor_link`: the plate feels its
    momentum and the joint feels it through the gear (Verdonck 2001, equations 8-13).
    """

    def __init__(self, spec: PlantSpec) -> None:
        self.spec = spec
        self.tree = read_tree(spec.urdf_text)
        self.moving = tuple(self.tree.joint(joint.name) for joint in spec.joints)
        self._refuse_extra_joints()
        self._rotors = [index for index, joint in enumerate(spec.joints) if joint.rotor_inertia_kg_m2 > 0.0]
        self.coupling = coupling_matrix(spec)
        self.model = _compile(spec, self.tree, self._rotors)
        self.data = mujoco.MjData(self.model)
        self._address = [int(self.model.joint(joint.name).dofadr[0]) for joint in spec.joints]
        self._rotor_address = [int(self.model.joint(_rotor_name(spec, i)).dofadr[0]) for i in self._rotors]
        self._plate_axes = np.eye(3) if spec.plate is None else rotation_from_rpy(spec.plate.rpy_rad)
        x, y, z = (0.0, 0.0, 0.0) if spec.plate is None else spec.plate.xyz_m
        self._lever = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])  # r x F of the plate's origin
        shift = self.model.nq - self.model.nv  # the free joint's quaternion has one number more
        self._angles = np.add(self._address, shift)
        self._gears = self.coupling[self._rotors]

    def _refuse_extra_joints(self) -> None:
        known = set(self.spec.joint_names)
        extra = [j.name for j in self.tree.joints if j.kind in MOVING and j.name not in known]
        if extra:
            raise PlantError(f"The URDF joint {extra[0]} has no [[joints]] entry in the plant: add one.")

    def inverse(
        self,
        q: np.ndarray,
        qd: np.ndarray,
        qdd: np.ndarray,
        rotor: tuple[np.ndarray, np.ndarray] | None = None,
        outside: Sequence[OutsideForce] = (),
        tilting: bool = False,
    ) -> RigidLoads:
        """Loads of the motion (n, k); `rotor`: joint speeds and accelerations of the motors if others."""
        count = len(q)
        speed, pull = rotor if rotor is not None else (qd, qdd)
        qpos, qvel, qacc = self._states(q, qd, qdd, speed, pull)
        raw = np.empty((count, self.model.nv))
        bearing = np.empty((count, len(self._address))) if tilting else None
        data, model, inverse = self.data, self.model, mujoco.mj_inverse
        position, velocity, acceleration, result = data.qpos, data.qvel, data.qacc, data.qfrc_inverse
        for index in range(count):
            position[:] = qpos[index]
            velocity[:] = qvel[index]
            acceleration[:] = qacc[index]
            inverse(model, data)
            raw[index] = result
            for force in outside:
                raw[index] -= self._generalised(force, index)
            if bearing is not None:
                bearing[index] = self._tilting()
        link = joint = raw[:, self._address]
        if self._rotors:
            joint = link + raw[:, self._rotor_address] @ self._gears
        return RigidLoads(joint, link, self._to_plate(raw[:, :_BASE_DOF]), bearing)

    def point(self, q: np.ndarray, link: str, point_m: np.ndarray) -> np.ndarray:
        """Position (3,) in the base frame of a link's point at joint angles (k,)."""
        self.data.qpos[:] = self._states(q[None], q[None], q[None], q[None], q[None])[0][0]
        mujoco.mj_kinematics(self.model, self.data)
        body = self.model.body(link).id
        return np.asarray(self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ point_m)

    def _states(
        self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, speed: np.ndarray, pull: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        count = len(q)
        qpos = np.repeat(self.model.qpos0[None], count, axis=0)
        qvel, qacc = np.zeros((2, count, self.model.nv))
        qpos[:, self._angles] = q
        qvel[:, self._address], qacc[:, self._address] = qd, qdd
        if self._rotors:  # a rotor's angle does not matter: it is a body of revolution
            qvel[:, self._rotor_address] = speed @ self._gears.T
            qacc[:, self._rotor_address] = pull @ self._gears.T
        return qpos, qvel, qacc

    def _generalised(self, force: OutsideForce, index: int) -> np.ndarray:
        body = self.model.body(force.link).id
        axes = self.data.xmat[body].reshape(3, 3)
        position = self.data.xpos[body] + axes @ force.point_m
        push, turn = force(index, position, axes)
        linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, linear, angular, position, body)
        return np.asarray(linear.T @ push + angular.T @ turn)

    def _tilting(self) -> np.ndarray:
        mujoco.mj_rnePostConstraint(self.model, self.data)
        moments = np.empty(len(self._address))
        for place, dof in enumerate(self._address):
            joint, body = int(self.model.dof_jntid[dof]), int(self.model.dof_bodyid[dof])
            spatial = self.data.cfrc_int[body]
            reference = self.data.subtree_com[self.model.body_rootid[body]]
            moment = spatial[:3] + np.cross(reference - self.data.xanchor[joint], spatial[3:])
            axis = self.data.xaxis[joint]
            moments[place] = np.linalg.norm(moment - axis * (axis @ moment))
        return moments

    def _to_plate(self, reaction: np.ndarray) -> np.ndarray:
        force, moment = reaction[:, :3], reaction[:, 3:]
        moment = moment - force @ self._lever.T
        return np.hstack([force @ self._plate_axes, moment @ self._plate_axes])


def coupling_matrix(spec: PlantSpec) -> np.ndarray:
    """Motor speed per joint speed (k, k): the gear ratios on the diagonal unless the plant says otherwise."""
    if spec.coupling is not None:
        return np.array(spec.coupling, dtype=float)
    return np.diag([joint.gear_ratio for joint in spec.joints])


def _rotor_name(spec: PlantSpec, index: int) -> str:
    return f"rotor of {spec.joints[index].name}"


def _tensor(six: Sequence[float]) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)


def _disk(inertia_kg_m2: float, axis: np.ndarray) -> np.ndarray:
    """Inertia of a thin disk with that polar inertia about `axis`."""
    along = np.outer(axis, axis)
    return inertia_kg_m2 * (along + 0.5 * (np.eye(3) - along))


def _compile(spec: PlantSpec, tree: Tree, rotors: list[int]) -> mujoco.MjModel:
    links = _true_inertials(spec, tree)
    disks = {index: _rotor_place(spec, tree, index) for index in rotors}
    worker = mujoco.MjSpec()
    worker.option.gravity = list(spec.gravity_m_s2)
    bodies = {tree.root: worker.worldbody.add_body(name=tree.root)}
    bodies[tree.root].add_freejoint(align=False)
    for joint in tree.joints:
        bodies[joint.child] = _add_link(bodies[joint.parent], joint)
    for name, body in bodies.items():
        carried = [
            _disk(spec.joints[i].rotor_inertia_kg_m2, axis)
            for i, (link, _, axis) in disks.items()
            if link == name
        ]
        _set_inertial(body, links.get(name), sum(carried, np.zeros((3, 3))), has_joint=_moves(tree, name))
    for index, (link, place, axis) in disks.items():
        _add_rotor(
            bodies[link], _rotor_name(spec, index), place, axis, spec.joints[index].rotor_inertia_kg_m2
        )
    try:
        model = worker.compile()
    except ValueError as error:
        raise PlantError(
            f"The plant {spec.name} has no physical inertials: {str(error).splitlines()[0]}."
        ) from None
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    return model


def _moves(tree: Tree, link: str) -> bool:
    return any(joint.child == link and joint.kind in MOVING for joint in tree.joints)


def _true_inertials(spec: PlantSpec, tree: Tree) -> dict[str, LinkInertial]:
    links = dict(tree.inertials)
    links.update({link.name: link for link in spec.links})
    for joint in tree.joints:
        if joint.kind in MOVING and joint.child not in links:
            raise PlantError(
                f"Link {joint.child} of {spec.name} has no inertials, in the URDF or the plant: "
                "a virtual robot needs mass, centre of mass and inertia of every moving link."
            )
    return links


def _add_link(parent: mujoco.MjsBody, joint: TreeJoint) -> mujoco.MjsBody:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, joint.rotation.ravel())
    body = parent.add_body(name=joint.child, pos=list(joint.xyz_m), quat=quaternion)
    if joint.kind in MOVING:
        slides = joint.kind == "prismatic"
        kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
        body.add_joint(name=joint.name, type=kind, axis=list(joint.axis))
    elif joint.kind != "fixed":
        raise PlantError(
            f"The URDF joint {joint.name} is {joint.kind}: use revolute, continuous, prismatic or fixed."
        )
    return body


def _set_inertial(
    body: mujoco.MjsBody, link: LinkInertial | None, rotors: np.ndarray, has_joint: bool
) -> None:
    if link is None and has_joint:
        raise PlantError(f"Link {body.name} has no inertials.")
    mass_kg = link.mass_kg if link else 1e-6  # a base without inertials weighs nothing that matters
    tensor = (_tensor(link.inertia_kg_m2) if link else np.eye(3) * 1e-6 + rotors) - rotors
    body.explicitinertial = True
    body.mass = mass_kg
    body.ipos = list(link.com_m if link else (0.0, 0.0, 0.0))
    body.fullinertia = [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]


def _rotor_place(spec: PlantSpec, tree: Tree, index: int) -> tuple[str, np.ndarray, np.ndarray]:
    """Link, position and axis (in that link's frame) of the rotor that drives joint `index`."""
    entry, joint = spec.joints[index], tree.joint(spec.joints[index].name)
    link = entry.rotor_link or joint.parent
    poses = tree.zero_pose()
    if link not in poses:
        raise PlantError(f"rotor_link {link} of {entry.name} is no link of the URDF.")
    position, rotation = poses[link]
    child_position, child_rotation = poses[joint.child]
    axis = (
        rotation.T @ child_rotation @ joint.axis if entry.rotor_axis is None else np.array(entry.rotor_axis)
    )
    return link, rotation.T @ (child_position - position), axis / np.linalg.norm(axis)


def _add_rotor(
    link: mujoco.MjsBody, name: str, place: np.ndarray, axis: np.ndarray, inertia_kg_m2: float
) -> None:
    turn = np.zeros(4)
    mujoco.mju_quatZ2Vec(turn, axis)
    body = link.add_body(name=name, pos=list(place), quat=turn)
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
    body.explicitinertial = True
    body.mass = _ROTOR_MASS_KG
    body.ipos, body.iquat = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]  # unset, MuJoCo takes the body's own pose
    half = 0.5 * inertia_kg_m2 * (1.0 + 1e-9)  # clear of the triangle inequality
    body.inertia = [half, half, inertia_kg_m2]
