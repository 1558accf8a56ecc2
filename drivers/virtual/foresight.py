"""A simulated run whose set points are known: physics is computed in blocks, and taken back if wrong.

The fake drives need a position and a current at every SYNC. One by one that costs ten times what a block of
instants costs. A block assumes that the coming set points are those of the script; the first one that is not
(a stop, a lost frame) restores the plant as it was before the block and goes on one by one.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np

from drivers.canopen.fake.robot_plant import RobotPlant
from drivers.virtual.plant import VirtualPlant
from drivers.virtual.record import current_noise
from drivers.virtual.robot import VirtualRobot
from drivers.virtual.sensors import quantise, stream_generator

_ROWS = 64
"""Set points of a block."""

_SAME_S = 1e-9
"""A SYNC this near to its place is in its place; another instant is computed by itself."""


@dataclass
class _Block:
    """Some periods computed ahead; row j holds for the SYNC after script row `first + j` was commanded."""

    before: VirtualPlant
    first: int
    at_s: np.ndarray
    position: np.ndarray
    current: np.ndarray


class ForesightPlant(RobotPlant):
    """A robot behind the drives that looks ahead in a script of set points.

    Args:
        robot: the robot.
        seed: of its noise.
    """

    def __init__(self, robot: VirtualRobot, seed: int) -> None:
        super().__init__(robot)
        self._virtual = robot
        self._script = np.empty((0, len(self._targets)))
        self._row = -1  # script row that the drives hold
        self._block: _Block | None = None
        self._encoder_random = stream_generator(seed, "encoder noise of the bus")
        self._current_noise = current_noise(robot.spec, stream_generator(seed, "current noise of the bus"))
        self._noise = np.empty((0, 2, len(self._targets)))

    def foresee(self, targets_rad: np.ndarray) -> None:
        """Take the set points (n, k) to come, exactly as the drives will command them."""
        self._script = np.asarray(targets_rad, dtype=float)

    def expect(self, row: int) -> None:
        """The drives command this script row at the coming SYNC."""
        self._row = row

    def _run(self) -> None:
        robot = self._virtual
        if robot.time_s >= self._last_s:
            return
        held = self._row - 1  # the coming row is not in force yet
        if self._block is not None and not self._goes_on(self._block, held):
            self._take_back(self._block, held)
        if self._block is None and 0 <= held < len(self._script) - 1 and self._is_script(held):
            self._look_ahead(held)
        if self._block is None:
            super()._run()
        robot.time_s = self._last_s

    def _is_script(self, row: int) -> bool:
        return bool(np.array_equal(self._targets, self._script[row]))

    def _goes_on(self, block: _Block, held: int) -> bool:
        """Whether what is commanded is what the block assumed; a block that is used up ends in agreement."""
        place = held - block.first
        if 0 <= place < len(block.at_s) and self._is_script(held):
            return abs(self._last_s - block.at_s[place]) < 0.5 * block.before.period_s
        if place == len(block.at_s) and self._last_s > block.at_s[-1]:
            self._block = None
            return True
        return False

    def _look_ahead(self, held: int) -> None:
        plant = self._virtual.plant
        behind = round((self._last_s - plant.time_s) / plant.period_s + 0.5)
        if behind != 1:
            return  # time has passed without SYNCs: first catch up
        rows = self._script[held : held + _ROWS]
        kept = (plant.rigid, plant.spec, plant.nominal)
        before = copy.deepcopy(plant, {id(part): part for part in kept})
        plant.follow(rows)
        at_s = self._last_s + plant.period_s * np.arange(len(rows))
        self._block = _Block(before, held, at_s, plant.encoders(at_s), plant.currents(at_s))

    def _take_back(self, block: _Block, held: int) -> None:
        """Restore the plant and repeat the set points that were in force since."""
        self._virtual.plant = self._plant = block.before
        done = min(held - block.first, len(block.at_s))
        if done > 0:
            block.before.follow(self._script[block.first : block.first + done])
        self._block = None

    def _sample(self) -> None:
        self._run()
        time_s, before = self._last_s, self._positions
        position, current = self._true_values(time_s)
        encoder, motor = self._next_noise()
        noise = self._virtual.spec.noise
        self._positions = quantise(position + encoder, noise.encoder_resolution_rad)
        self._currents = quantise(current + motor, noise.current_resolution_a)
        self._velocities = (self._positions - before) / (time_s - self._sampled_s)
        self._sampled_s = time_s

    def _true_values(self, time_s: float) -> tuple[np.ndarray, np.ndarray]:
        block = self._block
        if block is not None:
            place = self._row - 1 - block.first
            if 0 <= place < len(block.at_s) and abs(block.at_s[place] - time_s) < _SAME_S:
                return block.position[place], block.current[place]
        plant, instants = self._virtual.plant, np.array([time_s])
        return plant.encoders(instants)[0], plant.currents(instants)[0]

    def _next_noise(self) -> np.ndarray:
        """Encoder and current noise of one sample (2, k), drawn many at a time."""
        if not len(self._noise):
            spec, width = self._virtual.spec, len(self._targets)
            encoder = spec.noise.encoder_rad * self._encoder_random.standard_normal((_ROWS, width))
            self._noise = np.stack([encoder, self._current_noise.next(_ROWS)], axis=1)
        row, self._noise = self._noise[0], self._noise[1:]
        return row
