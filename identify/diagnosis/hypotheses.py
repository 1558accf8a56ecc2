"""What may have changed on a robot between two calibrations, as directions in the space of its parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.diagnosis.problem import Problem
from identify.inertia import PARAMETERS, UNITS
from identify.model import Model
from identify.physics.catalogue import catalogue
from identify.physics.effect import Place
from identify.rotations import FloatArray


@dataclass(frozen=True)
class Hypothesis:
    """One cause of a change.

    Attributes:
        effect: its name.
        joint: where, None for the payload.
        names: of its coefficients.
        units: of those.
        directions: change of (parameters, torque constants) per unit coefficient, shape (P + n, m).
    """

    effect: str
    joint: str | None
    names: tuple[str, ...]
    units: tuple[str, ...]
    directions: FloatArray


def hypotheses_of(problem: Problem) -> list[Hypothesis]:
    """List the causes that a robot's parameters can show.

    Args:
        problem: the new run's fit prepared for diagnosis.

    Returns:
        Payload; for every joint friction, torque constant, rotor, gravity compensation, offset.
    """
    model = problem.fit.model
    found = [_payload(model)]
    for index in range(model.robot.n):
        found += [
            _group(model, index, "friction", "friction_change", ("coulomb", "viscous", "asymmetric_viscous")),
            _constant(problem, index),
            _rotor(problem, index),
            _spring(model, index),
            _group(model, index, "offset", "offset_change", ("offset",)),
        ]
    return [item for item in found if item is not None and np.any(item.directions)]


def _size(model: Model) -> int:
    return len(model.parameters) + model.robot.n


def _payload(model: Model) -> Hypothesis:
    """Ten more parameters of the last link, through the definitions of the base parameters."""
    link = model.robot.link_names[-1]
    directions = np.zeros((_size(model), len(PARAMETERS)))
    for row, parameter in enumerate(model.parameters):
        for column, name in enumerate(PARAMETERS):
            directions[row, column] = parameter.definition.get(f"{link}.{name}", 0.0)
    return Hypothesis("payload", None, PARAMETERS, UNITS, directions)


def _pick(model: Model, names: list[str]) -> FloatArray:
    """Unit directions of parameters."""
    directions = np.zeros((_size(model), len(names)))
    for column, name in enumerate(names):
        directions[model.index(name), column] = 1.0
    return directions


def _group(model: Model, index: int, group: str, effect: str, terms: tuple[str, ...]) -> Hypothesis | None:
    joint = model.robot.joint_names[index]
    own = [p for p in model.parameters if p.group == group and p.joint == joint and p.name.rsplit(".", 1)[1] in terms]
    if not own:
        return None
    names = [p.name for p in own]
    return Hypothesis(effect, joint, tuple(n.rsplit(".", 1)[1] for n in names), tuple(p.unit for p in own), _pick(model, names))


def _spring(model: Model, index: int) -> Hypothesis | None:
    joint = model.robot.joint_names[index]
    own = [p for p in model.parameters if p.group == "gravity_compensation" and p.joint == joint]
    if not own:
        return None
    own += [p for p in model.parameters if p.group == "offset" and p.joint == joint]
    names = [p.name for p in own]
    short = tuple(n.rsplit(".", 1)[1] for n in names)
    return Hypothesis("gravity_compensation_spring", joint, short, tuple(p.unit for p in own), _pick(model, names))


def _constant(problem: Problem, index: int) -> Hypothesis | None:
    """A torque constant: its own entry where it is estimated, else what its change does to all the others."""
    model, name = problem.fit.model, problem.fit.model.robot.joint_names[index]
    if model.kind == "external":
        return None
    if index in problem.fit.solution.free_scales:
        directions = np.zeros((_size(model), 1))
        directions[len(model.parameters) + index, 0] = 1.0
        return Hypothesis("torque_constant_error", name, ("torque_constant",), ("N.m/A",), directions)
    return _apparent(problem, "torque_constant_error", index, "e", "")


def _rotor(problem: Problem, index: int) -> Hypothesis | None:
    model, joint = problem.fit.model, problem.fit.model.robot.joints[index]
    name = f"{joint.name}.rotor_inertia"
    if not joint.drive.has_rotor:
        return None
    if name in [p.name for p in model.parameters]:
        return Hypothesis("rotor_inertia", joint.name, ("rotor_inertia",), ("kg.m2",), _pick(model, [name]))
    return _apparent(problem, "rotor_inertia", index, "rotor_inertia", "kg.m2")


def _apparent(problem: Problem, effect_name: str, index: int, coefficient: str, unit: str) -> Hypothesis | None:
    """How a fit without an effect bends its parameters when the effect is there."""
    effect = catalogue().get(effect_name)
    if effect is None:
        return None
    model, solution = problem.fit.model, problem.fit.solution
    columns = _columns(problem, effect_name, index)
    jacobian = solution.jacobian
    norms = np.linalg.norm(jacobian, axis=0)
    safe = np.where(norms > 0, norms, 1.0)
    shift = np.linalg.lstsq(jacobian / safe, columns, rcond=1e-9)[0][:, 0] / safe
    directions, count = np.zeros((_size(model), 1)), len(model.parameters)
    directions[:count, 0] = shift[:count]
    for column, joint in enumerate(solution.free_scales):
        nominal = model.robot.joints[joint].drive.torque_constant or 1.0
        directions[count + joint, 0] = -nominal / solution.scale[joint] ** 2 * shift[count + column]
    return Hypothesis(effect_name, model.robot.joint_names[index], (coefficient,), (unit,), directions)


def _columns(problem: Problem, effect_name: str, index: int) -> FloatArray:
    """Whitened column of an effect; of a torque constant simply the joint's own prediction."""
    if effect_name != "torque_constant_error":
        return problem.columns(catalogue()[effect_name], Place(joint=index), {})
    raw = []
    for block_index, (block, scene) in enumerate(zip(problem.blocks, problem.scenes, strict=True)):
        column = np.zeros((scene.rows, 1, scene.q.shape[1]))
        column[index, 0] = scene.torque[index]
        raw.append(problem.enter(block_index, column))
        assert raw[-1].shape[0] == len(block.channels)
    return problem.whiten(raw)
