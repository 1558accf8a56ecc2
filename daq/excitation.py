"""The periodic motion of an ``excitation.json``: finite Fourier series of one fundamental."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from daq.errors import UsageError

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]
"""q, qd, qdd, each (n, k)."""

_NEEDED = ("joints", "fundamental_hz", "offset", "cosine", "sine")


@dataclass(frozen=True)
class Excitation:
    """q_j(t) = offset + sum_h cosine cos(2 pi h f t) + sine sin(2 pi h f t).

    Attributes:
        joints: names in the order of the columns.
        fundamental_hz: repetition rate.
        offset: (k,) rad or m.
        cosine: (k, harmonics).
        sine: (k, harmonics).
        sample_rate_hz: what the design assumed, None where it does not say.
        robot: the robot it was designed for, empty where it does not say.
        ramp_s: duration of the ramp it was checked with, None where it does not say.
        text: the file as read, to be carried along in the log.

    Source:
        Verdonck, Swevers, Samin 2001, equation (14).
    """

    joints: tuple[str, ...]
    fundamental_hz: float
    offset: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray
    sample_rate_hz: float | None = None
    robot: str = ""
    ramp_s: float | None = None
    text: str = ""

    @property
    def harmonics(self) -> int:
        """Number of lines."""
        return int(self.cosine.shape[1])

    @property
    def period_s(self) -> float:
        """Duration of one period."""
        return 1.0 / self.fundamental_hz

    def evaluate(self, t_s: np.ndarray) -> Motion:
        """Position, velocity and acceleration (n, k) at instants (n,)."""
        w = 2.0 * np.pi * self.fundamental_hz * np.arange(1, self.harmonics + 1)
        phase = np.outer(t_s, w)
        cosines, sines = np.cos(phase), np.sin(phase)
        q = self.offset + cosines @ self.cosine.T + sines @ self.sine.T
        qd = cosines @ (self.sine * w).T - sines @ (self.cosine * w).T
        qdd = -cosines @ (self.cosine * w**2).T - sines @ (self.sine * w**2).T
        return q, qd, qdd

    def ordered(self, joints: tuple[str, ...]) -> Excitation:
        """The same motion with its columns in another order of the same joints.

        Raises:
            UsageError: the joints differ.
        """
        if sorted(joints) != sorted(self.joints):
            raise UsageError(
                f"The excitation moves {', '.join(self.joints)} but the robot has {', '.join(joints)}; "
                "design an excitation for this robot with residuum design."
            )
        order = [self.joints.index(name) for name in joints]
        return replace(
            self, joints=joints, offset=self.offset[order], cosine=self.cosine[order], sine=self.sine[order]
        )

    def in_whole_cycles(self, bus_period_s: float) -> tuple[Excitation, int]:
        """The motion with a period of a whole number of bus cycles, and that number.

        A SYNC period seldom divides the designed period; the motion is slowed or sped up by at most half a
        cycle a period, so that every period is commanded by the very same set points.
        """
        cycles = max(1, round(self.period_s / bus_period_s))
        return replace(self, fundamental_hz=1.0 / (cycles * bus_period_s)), cycles


def read_excitation(path: str | Path) -> Excitation:
    """Read and check an ``excitation.json``.

    Raises:
        UsageError: missing, not JSON, incomplete, not finite, or changed after its check.
    """
    try:
        text = Path(path).read_text("utf-8")
        content = json.loads(text)
    except OSError as error:
        raise UsageError(f"The excitation {path} cannot be read: {error.strerror or error}; "
                         f"write one with residuum design.") from error
    except ValueError as error:
        raise UsageError(f"The excitation {path} is not JSON: {error}.") from error
    return excitation_of(content, str(path), text)


def excitation_of(content: Mapping[str, Any], where: str, text: str = "") -> Excitation:
    """Check the content of an ``excitation.json``."""
    lacking = [key for key in _NEEDED if not isinstance(content, Mapping) or key not in content]
    if lacking:
        raise UsageError(f"The excitation {where} lacks '{lacking[0]}'; write it anew with residuum design.")
    try:
        offset, cosine, sine = (np.array(content[key], dtype=float) for key in ("offset", "cosine", "sine"))
        fundamental_hz = float(content["fundamental_hz"])
        rate_hz = content.get("sample_rate_hz")
        joints = tuple(str(name) for name in content["joints"])
    except (TypeError, ValueError) as error:
        raise UsageError(f"The excitation {where} holds something that is no number ({error}).") from error
    _check(where, joints, fundamental_hz, offset, cosine, sine)
    _check_hash(where, content)
    return Excitation(
        joints, fundamental_hz, offset, cosine, sine,
        sample_rate_hz=float(rate_hz) if isinstance(rate_hz, int | float) else None,
        robot=str(content.get("robot", "")), ramp_s=_ramp_s(content), text=text,
    )


def _check(
    where: str, joints: tuple[str, ...], fundamental_hz: float,
    offset: np.ndarray, cosine: np.ndarray, sine: np.ndarray,
) -> None:
    count = len(joints)
    shapes = offset.shape == (count,) and cosine.ndim == 2 and cosine.shape == sine.shape
    if not count or not shapes or cosine.shape[0] != count or not cosine.shape[1]:
        raise UsageError(
            f"The excitation {where} has coefficients of shapes {offset.shape}, {cosine.shape}, {sine.shape} "
            f"for {count} joints; it needs (n), (n, harmonics), (n, harmonics)."
        )
    finite = all(np.isfinite(part).all() for part in (offset, cosine, sine))
    if not finite or not np.isfinite(fundamental_hz) or fundamental_hz <= 0.0:
        raise UsageError(f"The excitation {where} holds a coefficient or frequency that is not finite or not "
                         f"positive; write it anew with residuum design.")


def _check_hash(where: str, content: Mapping[str, Any]) -> None:
    """The hash covers everything else, as JSON with sorted keys and no spaces."""
    if "hash" not in content:
        return
    rest = {key: value for key, value in content.items() if key != "hash"}
    canonical = json.dumps(rest, sort_keys=True, separators=(",", ":"))
    if hashlib.sha256(canonical.encode()).hexdigest() != content["hash"]:
        raise UsageError(
            f"The excitation {where} was changed after it was checked (its hash does not match); restore it, "
            "or write it anew with residuum design."
        )


def _ramp_s(content: Mapping[str, Any]) -> float | None:
    limits = content.get("limits")
    ramp = limits.get("ramp") if isinstance(limits, Mapping) else None
    value = ramp.get("duration_s") if isinstance(ramp, Mapping) else None
    return float(value) if isinstance(value, int | float) and value > 0 else None
