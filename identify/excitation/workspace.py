"""What the links must not touch: floor, plate, obstacles and each other, as spheres on links."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np

from identify.excitation.errors import DesignError
from identify.kinematics import cross, rotate
from identify.robot import Robot
from identify.rotations import FloatArray, axis_rotation
from identify.urdf import Chain


@dataclass(frozen=True)
class Sphere:
    """A ball fixed to a link; radius zero makes it a point.

    Attributes:
        link: index of the moving link, -1 for the base.
        center_m: in the link's joint frame [m], shape (3,).
        radius_m: [m].
        name: for messages.
    """

    link: int
    center_m: FloatArray
    radius_m: float
    name: str


@dataclass(frozen=True)
class Box:
    """A solid box along the base frame's axes.

    Attributes:
        lower_m: corner [m], shape (3,).
        upper_m: opposite corner [m], shape (3,).
        name: for messages.
    """

    lower_m: FloatArray
    upper_m: FloatArray
    name: str = "box"

    def distance_m(self, point_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance of points (3, N) from the surface, negative inside, and its gradient (3, N)."""
        lower, upper = self.lower_m[:, None], self.upper_m[:, None]
        outside = np.maximum(point_m - upper, 0.0) - np.maximum(lower - point_m, 0.0)
        far = np.linalg.norm(outside, axis=0)
        depth = np.maximum(lower - point_m, point_m - upper)  # all negative inside
        nearest = np.argmax(depth, axis=0)
        columns = np.arange(point_m.shape[1])
        inward = np.zeros_like(point_m)
        inward[nearest, columns] = np.where(
            (point_m - upper)[nearest, columns] >= (lower - point_m)[nearest, columns], 1.0, -1.0
        )
        gradient = np.where(far > 0.0, outside / np.maximum(far, 1e-12), inward)
        return np.where(far > 0.0, far, depth[nearest, columns]), gradient


@dataclass(frozen=True)
class Workspace:
    """Obstacles and the robot's own body.

    Attributes:
        spheres: on the links and the base.
        floor_m: height of the floor in the base frame [m]; None where there is none.
        boxes: the plate's box and other obstacles.
        pairs: indices of spheres that must not meet.
        margin_m: distance kept from everything [m].
    """

    spheres: tuple[Sphere, ...] = ()
    floor_m: float | None = None
    boxes: tuple[Box, ...] = ()
    pairs: tuple[tuple[int, int], ...] = ()
    margin_m: float = 0.01

    @property
    def empty(self) -> bool:
        """Whether nothing constrains."""
        return not self.spheres or (self.floor_m is None and not self.boxes and not self.pairs)


def distant_pairs(spheres: tuple[Sphere, ...]) -> tuple[tuple[int, int], ...]:
    """Pair the spheres of links that are not neighbours in the chain."""
    return tuple(
        (i, j)
        for i in range(len(spheres))
        for j in range(i + 1, len(spheres))
        if abs(spheres[i].link - spheres[j].link) > 1
    )


def urdf_spheres(urdf_text: str, chain: Chain) -> tuple[Sphere, ...]:
    """Read the collision spheres of a URDF; other shapes are left out.

    Args:
        urdf_text: the document.
        chain: its chain, for the frames.

    Returns:
        Spheres in the joint frames.
    """
    spheres = []
    for link in ElementTree.fromstring(urdf_text).findall("link"):
        name = link.get("name", "")
        if name not in chain.link_of:
            continue
        rotation, translation = chain.pose_of[name]
        for collision in link.findall("collision"):
            ball = collision.find("geometry/sphere")
            if ball is None:
                continue
            origin = collision.find("origin")
            xyz = (origin.get("xyz") if origin is not None else None) or "0 0 0"
            center = translation + rotation @ np.array([float(word) for word in xyz.split()])
            spheres.append(Sphere(chain.link_of[name], center, float(ball.get("radius", "0")), name))
    return tuple(spheres)


@dataclass(frozen=True)
class Poses:
    """Frames of all links over N instants.

    Attributes:
        rotation: shape (n, 3, 3, N).
        origin_m: shape (n, 3, N).
        axis: joint axes, shape (n, 3, N).
    """

    rotation: FloatArray
    origin_m: FloatArray
    axis: FloatArray


def link_poses(robot: Robot, q: FloatArray) -> Poses:
    """Place all links; positions q (n, N)."""
    count = q.shape[1]
    rotation, origin = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, count)), np.zeros((3, count))
    rotations, origins, axes = [], [], []
    for index, joint in enumerate(robot.joints):
        origin = origin + rotate(rotation, joint.translation_m)
        rotation = np.einsum("ijn,jk->ikn", rotation, joint.rotation)
        axis = rotate(rotation, joint.axis)
        if joint.prismatic:
            origin = origin + axis * q[index]
        else:
            rotation = np.einsum("ijn,jkn->ikn", rotation, axis_rotation(joint.axis, q[index]))
        rotations.append(rotation)
        origins.append(origin)
        axes.append(axis)
    return Poses(np.array(rotations), np.array(origins), np.array(axes))


@dataclass(frozen=True)
class Clearances:
    """Distances that must stay positive.

    Attributes:
        names: one a constraint.
        distance_m: less the margin [m], shape (k, N).
        gradient: by the joint positions, shape (k, n, N).
        moving_m: the point, or difference of points, whose distance it is [m], shape (k, 3, N).
    """

    names: tuple[str, ...]
    distance_m: FloatArray
    gradient: FloatArray
    moving_m: FloatArray


def _sphere_points(robot: Robot, workspace: Workspace, poses: Poses) -> tuple[FloatArray, FloatArray]:
    """Centres (s, 3, N) and their Jacobians (s, 3, n, N)."""
    count = poses.origin_m.shape[2]
    points = np.empty((len(workspace.spheres), 3, count))
    jacobians = np.zeros((len(workspace.spheres), 3, robot.n, count))
    for k, sphere in enumerate(workspace.spheres):
        if sphere.link < 0:
            points[k] = sphere.center_m[:, None]
            continue
        points[k] = poses.origin_m[sphere.link] + rotate(poses.rotation[sphere.link], sphere.center_m)
        for joint in range(sphere.link + 1):
            axis = poses.axis[joint]
            sliding = robot.joints[joint].prismatic
            jacobians[k, :, joint] = axis if sliding else cross(axis, points[k] - poses.origin_m[joint])
    return points, jacobians


def clearances(robot: Robot, workspace: Workspace, q: FloatArray) -> Clearances:
    """Measure all distances.

    Args:
        robot: the chain.
        workspace: bodies and obstacles.
        q: positions, shape (n, N).

    Returns:
        Distances less the margin, and their gradients.
    """
    points, jacobians = _sphere_points(robot, workspace, link_poses(robot, q))
    names, distances, gradients, moving = [], [], [], []
    for k, sphere in enumerate(workspace.spheres):
        if sphere.link < 0:
            continue
        if workspace.floor_m is not None:
            names.append(f"{sphere.name} and the floor")
            distances.append(points[k, 2] - workspace.floor_m - sphere.radius_m)
            gradients.append(jacobians[k, 2])
            moving.append(points[k] * np.array([[0.0], [0.0], [1.0]]))
        for box in workspace.boxes:
            far, slope = box.distance_m(points[k])
            names.append(f"{sphere.name} and {box.name}")
            distances.append(far - sphere.radius_m)
            gradients.append(np.einsum("in,ijn->jn", slope, jacobians[k]))
            moving.append(points[k])
    for i, j in workspace.pairs:
        between = points[i] - points[j]
        far = np.linalg.norm(between, axis=0)
        names.append(f"{workspace.spheres[i].name} and {workspace.spheres[j].name}")
        distances.append(far - workspace.spheres[i].radius_m - workspace.spheres[j].radius_m)
        slope = between / np.maximum(far, 1e-9)
        gradients.append(np.einsum("in,ijn->jn", slope, jacobians[i] - jacobians[j]))
        moving.append(between)
    if not names:
        return Clearances(
            (), np.zeros((0, q.shape[1])), np.zeros((0, *q.shape)), np.zeros((0, 3, q.shape[1]))
        )
    return Clearances(
        tuple(names), np.array(distances) - workspace.margin_m, np.array(gradients), np.array(moving)
    )


def check_workspace(robot: Robot, workspace: Workspace) -> None:
    """Refuse a workspace that names links or spheres the robot does not have.

    Raises:
        DesignError: an index is out of range.
    """
    for sphere in workspace.spheres:
        if not -1 <= sphere.link < robot.n:
            raise DesignError(
                f"Sphere '{sphere.name}' sits on link {sphere.link}, but the robot has links 0 "
                f"to {robot.n - 1}."
            )
        if sphere.radius_m < 0.0:
            raise DesignError(
                f"Sphere '{sphere.name}' has the radius {sphere.radius_m:g} m; give zero or more."
            )
    for i, j in workspace.pairs:
        if not (0 <= i < len(workspace.spheres) and 0 <= j < len(workspace.spheres)):
            raise DesignError(
                f"Pair {i}, {j} names a sphere that does not exist: there are {len(workspace.spheres)}."
            )


def box_around_plate(robot: Robot, size_m: tuple[float, float, float]) -> Box | None:
    """Give the box of a plate whose top surface is centred at the plate's frame, None without a plate."""
    if robot.plate is None:
        return None
    half = np.array([size_m[0] / 2.0, size_m[1] / 2.0, 0.0])
    top = robot.plate.translation_m
    return Box(top - half - np.array([0.0, 0.0, size_m[2]]), top + half, "the force plate")


def always_meeting(
    robot: Robot, spheres: tuple[Sphere, ...], pairs: tuple[tuple[int, int], ...]
) -> tuple[tuple[int, int], ...]:
    """Find the pairs that overlap in every pose: neighbours in shape, if not in the chain."""
    if not pairs:
        return ()
    rng = np.random.default_rng(3)
    lower = np.array([max(joint.limits.lower, -np.pi) for joint in robot.joints])
    upper = np.array([min(joint.limits.upper, np.pi) for joint in robot.joints])
    q = rng.uniform(lower[:, None], upper[:, None], (robot.n, 200))
    found = clearances(robot, Workspace(spheres, pairs=pairs, margin_m=0.0), q)
    return tuple(pair for pair, gap in zip(pairs, found.distance_m, strict=True) if gap.max() < 0.0)
