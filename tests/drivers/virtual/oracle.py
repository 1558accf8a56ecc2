"""Pinocchio as the second opinion on rigid-body dynamics: links only, rotors locked."""

import numpy as np
import pinocchio

from drivers.virtual.rigid import _true_inertials
from drivers.virtual.urdf_tree import read_tree


def pinocchio_model(plant):
    tree = read_tree(plant.urdf_text)
    links = _true_inertials(plant, tree)
    model = pinocchio.Model()
    root = model.addJoint(0, pinocchio.JointModelFreeFlyer(), pinocchio.SE3.Identity(), "root")
    place = {tree.root: root}
    _append(model, root, links.get(tree.root))
    for joint in tree.joints:
        pose = pinocchio.SE3(joint.rotation, np.array(joint.xyz_m))
        kind = pinocchio.JointModelRevoluteUnaligned(joint.axis)
        place[joint.child] = model.addJoint(place[joint.parent], kind, pose, joint.name)
        _append(model, place[joint.child], links[joint.child])
    model.gravity.linear = np.array(plant.gravity_m_s2)
    return model


def _append(model, joint, link):
    if link is None:
        return
    xx, yy, zz, xy, xz, yz = link.inertia_kg_m2
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inertia = pinocchio.Inertia(link.mass_kg, np.array(link.com_m), tensor)
    model.appendBodyToJoint(joint, inertia, pinocchio.SE3.Identity())


def pinocchio_loads(plant, q, qd, qdd):
    """Joint torques (n, k) and the base's reaction (n, 6)."""
    model = pinocchio_model(plant)
    data = model.createData()
    rest = np.array([0.0, 0, 0, 0, 0, 0, 1])
    out = [
        pinocchio.rnea(model, data, np.r_[rest, a], np.r_[np.zeros(6), b], np.r_[np.zeros(6), c])
        for a, b, c in zip(q, qd, qdd, strict=True)
    ]
    raw = np.array(out)
    return raw[:, 6:], raw[:, :6]


def pinocchio_energy(plant, q, qd):
    """Kinetic plus potential energy (n,) of the links."""
    model = pinocchio_model(plant)
    data = model.createData()
    rest = np.array([0.0, 0, 0, 0, 0, 0, 1])
    total = []
    for a, b in zip(q, qd, strict=True):
        kinetic = pinocchio.computeKineticEnergy(model, data, np.r_[rest, a], np.r_[np.zeros(6), b])
        total.append(kinetic + pinocchio.computePotentialEnergy(model, data, np.r_[rest, a]))
    return np.array(total)
