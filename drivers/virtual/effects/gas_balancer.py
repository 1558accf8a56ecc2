"""A gas cylinder that balances a joint, with the heat its gas takes and gives."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import noise_nm
from drivers.virtual.history import History
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads, RigidPlant
from drivers.virtual.servo import Moments

_ADIABATIC = 1.4  # nitrogen
_RADIUS_A_M, _RADIUS_B_M = 0.40, 0.08
_GAS_LENGTH_M = 0.25  # volume over piston area at rest


class GasBalancer(Effect):
    """Pressure force p0 A (V0 / V) T / T0 on a lever; slow moves are isothermal, fast ones adiabatic.

    The gas temperature follows the compression work and relaxes to the wall within `heat_time_s`, which makes
    the force lag: a spring with a loop that depends on speed.
    """

    name = "gas_balancer"
    where = "I"
    size = "force_n"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "force_n": Range(20.0 * noise_nm(plant, j), 300.0 * noise_nm(plant, j), "N"),
            "heat_time_s": Range(0.5, 10.0, "s"),
        }

    def begin(self, step_s: float, history: History, rigid: RigidPlant) -> None:
        """Start at the wall's temperature."""
        self._history, self._step_s = history, step_s
        self._heat, self._length = 1.0, None

    def tick(self, moments: Moments, loads: RigidLoads | None) -> None:
        """Carry the gas temperature (over the wall's) from tick to tick."""
        if self.p["force_n"] == 0.0:
            return
        length = _gas_length(moments.q[:, self.j])[0]
        before = length[:1] if self._length is None else np.array([self._length])
        chain = np.concatenate([before, length])
        work = ((chain[:-1] / chain[1:]) ** (_ADIABATIC - 1.0)).tolist()
        keep = float(np.exp(-self._step_s / self.p["heat_time_s"]))
        heat, heats = self._heat, []
        for factor in work:
            heat = 1.0 + (heat * factor - 1.0) * keep
            heats.append(heat)
        self._heat, self._length = heat, float(length[-1])
        self._history.append(**{self.key: np.array(heats)})

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Torque against the gas (n, k)."""
        if self.p["force_n"] == 0.0:
            return np.zeros_like(moments.q)
        length, lever = _gas_length(moments.q[:, self.j])
        heat = self._history.straight(self.key, moments.tick, moments.fraction)
        return self.column(self.p["force_n"] * heat * (_GAS_LENGTH_M / length) * lever)


def _gas_length(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Length of the gas column (n,) and the rod's lever (n,) at joint angles (n,)."""
    product = _RADIUS_A_M * _RADIUS_B_M
    rod = np.sqrt(_RADIUS_A_M**2 + _RADIUS_B_M**2 - 2.0 * product * np.cos(angle))
    pushed_in = rod - (_RADIUS_A_M - _RADIUS_B_M)
    return _GAS_LENGTH_M - pushed_in, product * np.sin(angle) / rod
