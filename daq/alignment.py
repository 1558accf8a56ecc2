"""A recording as one table on a uniform grid, for those who want a table.

Nothing in the identification needs this: it takes every stream at its own instants.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from daq.band_limited import NOISE_SHARE, resample
from daq.errors import DataError, UsageError
from daq.recording import Recording, Stream

RATE_HZ = 150.0
"""Default rate of the grid."""

_BAND_SHARE = 0.4
"""Band limit as a share of the sample rate: what lies between it and one half is guard band."""

_FOLDING_SHARE = 0.45
"""A band beyond this share of the grid's rate is cut back to `_BAND_SHARE`."""

_HOLE_PERIODS = 1.75
"""Two samples farther apart than this many median periods have a hole between them."""

_LEAST_SAMPLES = 16


@dataclass(frozen=True)
class AlignedTable:
    """All streams of a recording at common instants.

    Attributes:
        stamp_ns: (n,) int64, evenly spaced.
        columns: (n,) float64 by name, such as ``joint_states.position.joint_1`` or ``wrench.force.x``;
            NaN in holes and where a stream has not begun or has ended.
        rate_hz: of the grid.
        method: what was done, in words.
    """

    stamp_ns: np.ndarray
    columns: Mapping[str, np.ndarray]
    rate_hz: float
    method: str


def align(recording: Recording, rate_hz: float = RATE_HZ) -> AlignedTable:
    """Resample every stream to one uniform grid over the joint states' time.

    Raises:
        UsageError: a rate that is not positive.
        DataError: too few joint states, or too many instants.
    """
    if not rate_hz > 0:
        raise UsageError(f"A table cannot be sampled at {rate_hz} Hz; give a positive rate.")
    joint_states = recording.joint_states
    if len(joint_states) < _LEAST_SAMPLES:
        raise DataError(
            f"{recording.source} has only {len(joint_states)} joint states, too few to resample; "
            f"a table needs {_LEAST_SAMPLES}."
        )
    start_ns, end_ns = int(joint_states.stamp_ns.min()), int(joint_states.stamp_ns.max())
    count = int((end_ns - start_ns) * 1e-9 * rate_hz) + 1
    stamp_ns = start_ns + np.rint(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)
    columns: dict[str, np.ndarray] = {}
    parts = {
        "joint_states": joint_states,
        "motor_currents": recording.motor_currents,
        "wrench": recording.wrench,
        "setpoints": recording.setpoints,
    }
    for name, stream in parts.items():
        if stream is not None and len(stream) >= _LEAST_SAMPLES:
            columns |= _columns(name, stream, stamp_ns, rate_hz)
    return AlignedTable(stamp_ns, columns, rate_hz, _method(rate_hz))


def _method(rate_hz: float) -> str:
    return (
        "minimum-error band-limited interpolation of the unevenly spaced samples (Yen 1956, noise share "
        f"{NOISE_SHARE:g}), band limit {_BAND_SHARE:g} of the slower of the stream and {rate_hz:g} Hz; "
        f"NaN between samples more than {_HOLE_PERIODS:g} periods apart and outside a stream"
    )


def _columns(name: str, stream: Stream, stamp_ns: np.ndarray, rate_hz: float) -> dict[str, np.ndarray]:
    sample_ns, kept = np.unique(stream.stamp_ns, return_index=True)
    start_ns = int(stamp_ns[0])
    t_s, at_s = (sample_ns - start_ns) * 1e-9, (stamp_ns - start_ns) * 1e-9
    period_s = float(np.median(np.diff(t_s)))
    labels, blocks = [], []
    for quantity, block in stream.data.items():
        parts = stream.names or ("x", "y", "z")
        labels += [f"{name}.{quantity}.{part}" for part in parts]
        blocks.append(np.asarray(block)[kept])
    values = np.concatenate(blocks, axis=1)
    is_covered = _covered(t_s, at_s, _HOLE_PERIODS * period_s)
    signal_band_hz = _BAND_SHARE / period_s
    # Thinning is needed only where the stream's band would fold back on the grid.
    band_hz = signal_band_hz if signal_band_hz < _FOLDING_SHARE * rate_hz else _BAND_SHARE * rate_hz
    table = np.full((len(at_s), values.shape[1]), np.nan)
    table[is_covered] = resample(
        t_s, values, at_s[is_covered], band_hz=band_hz, signal_band_hz=signal_band_hz
    )
    return dict(zip(labels, table.T, strict=True))


def _covered(t_s: np.ndarray, at_s: np.ndarray, longest_gap_s: float) -> np.ndarray:
    """Tell which instants lie between two samples that are close enough."""
    right = np.searchsorted(t_s, at_s, side="left")
    is_hit = t_s[np.minimum(right, len(t_s) - 1)] == at_s
    is_inside = (right > 0) & (right < len(t_s))
    bounded = np.clip(right, 1, len(t_s) - 1)
    return is_hit | (is_inside & (t_s[bounded] - t_s[bounded - 1] <= longest_gap_s))
