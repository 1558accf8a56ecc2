"""What every effect of the catalogue is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from identify.physics.scene import Scene
from identify.rotations import FloatArray


@dataclass(frozen=True)
class Shape:
    """A parameter that enters the columns nonlinearly.

    Attributes:
        name: such as ``vs``.
        unit: SI.
        grid: values tried first, increasing; its ends bound the refinement.
        continuous: False where only the values of the grid make sense (orders).
    """

    name: str
    unit: str
    grid: tuple[float, ...]
    continuous: bool = True


@dataclass(frozen=True)
class Place:
    """Where an effect sits.

    Attributes:
        joint: index of the joint, None for plate and whole-robot effects.
        channel: wrench channel, or ``from->to`` for crosstalk, None elsewhere.
        partner: index of a second joint (coupled transmissions), None elsewhere.
    """

    joint: int | None = None
    channel: str | None = None
    partner: int | None = None


@dataclass(frozen=True)
class Coefficient:
    """A parameter that enters linearly.

    Attributes:
        name: such as ``fs_minus_fc``.
        unit: SI; ``N.m`` becomes ``N`` on a prismatic joint.
        sign: +1 where physics allows only positive values, -1 only negative, 0 either.
    """

    name: str
    unit: str
    sign: int = 0


Columns = Callable[[Scene, Place, Mapping[str, float]], FloatArray]
Constraint = Callable[[Scene, Place, FloatArray, Mapping[str, float]], bool]


def _always(scene: Scene, place: Place, values: FloatArray, shape: Mapping[str, float]) -> bool:
    return True


@dataclass(frozen=True)
class Effect:
    """One effect of the catalogue.

    Attributes:
        name: as in the catalogue, spelled exactly.
        where: ``I`` motor current only, ``B`` both, ``P`` plate only, ``S`` sensing or timing.
        parity: ``E``, ``O``, ``X`` under time reversal of the path.
        coefficients: linear parameters, one a column.
        columns: what the model lacks, drive rows [N.m or N] then wrench rows, per unit coefficient,
            shape (n + 6, k, B) on the scene's grid (n rows only where there is no plate).
        places: where it can sit on a robot.
        sentence: template for people; ``{place}`` and the parameters' names are filled in.
        reference: source.
        shapes: nonlinear parameters.
        constraint: further physical constraint on the fitted values; a fit that violates it is not this effect.
        progressive: True where the effect is what changes over the run: the columns are then multiplied by a
            course in time (a ramp, or the approach to a steady state) instead of repeating every period.
        settling: columns of what dies out exponentially after the run's start because of this effect, with one
            time constant for all of them; None where nothing does.
    """

    name: str
    where: str
    parity: str
    coefficients: tuple[Coefficient, ...]
    columns: Columns
    places: Callable[[Scene], list[Place]]
    sentence: str
    reference: str
    shapes: tuple[Shape, ...] = ()
    constraint: Constraint = _always
    progressive: bool = False
    settling: Callable[[Scene, Place], FloatArray] | None = None
    size_of: Callable[[FloatArray, Mapping[str, float]], float] = field(default=lambda values, shape: float(np.linalg.norm(values)))

    @property
    def unit(self) -> str:
        """Unit of its size: that of its first coefficient."""
        return self.coefficients[0].unit

    def allowed(self, scene: Scene, place: Place, values: FloatArray, shape: Mapping[str, float]) -> bool:
        """Tell whether fitted values obey the signs and the constraint."""
        signs = np.array([coefficient.sign for coefficient in self.coefficients])
        return bool((signs * values >= 0.0).all()) and self.constraint(scene, place, values, shape)


def every_joint(scene: Scene) -> list[Place]:
    """All joints."""
    return [Place(joint=k) for k in range(scene.robot.n)]


def every_revolute(scene: Scene) -> list[Place]:
    """All revolute joints."""
    return [Place(joint=k) for k, joint in enumerate(scene.robot.joints) if not joint.prismatic]


def whole_robot(scene: Scene) -> list[Place]:
    """The robot as a whole, where there is a plate or not."""
    return [Place()]


def whole_plate(scene: Scene) -> list[Place]:
    """The plate as a whole, where there is one."""
    return [Place()] if scene.has_wrench else []


def only_joint(scene: Scene, joint: int, column: FloatArray) -> FloatArray:
    """Columns of one drive row alone.

    Args:
        scene: the scene.
        joint: its index.
        column: shape (B,) or (k, B).

    Returns:
        Shape (rows, k, B), zero elsewhere.
    """
    column = np.atleast_2d(column)
    result = np.zeros((scene.rows, *column.shape))
    result[joint] = column
    return result


def only_wrench(scene: Scene, column: FloatArray) -> FloatArray:
    """Columns of the wrench rows alone.

    Args:
        scene: the scene.
        column: shape (6, B) or (6, k, B).

    Returns:
        Shape (rows, k, B), zero on the drives.
    """
    column = column[:, None, :] if column.ndim == 2 else column
    result = np.zeros((scene.rows, *column.shape[1:]))
    result[scene.robot.n :] = column
    return result
