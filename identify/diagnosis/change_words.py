"""A change since an earlier calibration as a finding: its numbers and its sentence."""

from __future__ import annotations

import numpy as np

from identify.diagnosis.change import NamedChange, State
from identify.diagnosis.findings import Finding, FoundParameter, Where, rounded
from identify.model import Model

_REGION = "the whole motion, since the reference"


def change_finding(model: Model, change: NamedChange, now: State, reference: State) -> Finding:
    """Put a named change into the form of a finding.

    Args:
        model: of both estimates.
        change: the change.
        now: the new estimate.
        reference: the earlier one.

    Returns:
        The finding.
    """
    cause = change.hypothesis
    parameters = _parameters(model, change, reference)
    alternatives = tuple(dict.fromkeys(r.effect for r in change.rivals if r.effect != cause.effect))[:4]
    channels = (cause.joint,) if cause.joint is not None else model.channels
    return Finding(
        cause.effect, cause.joint, None, parameters, change.p_value, change.gain, alternatives,
        Where(channels, _REGION, ()), _sentence(model, change, parameters, reference),
    )


def _number(change: NamedChange, index: int) -> tuple[float, float]:
    return float(change.values[index]), float(np.sqrt(change.covariance[index, index]))


def _parameters(model: Model, change: NamedChange, reference: State) -> tuple[FoundParameter, ...]:
    cause, result = change.hypothesis, []
    if cause.effect == "torque_constant_error":
        return _constant_parameters(model, change, reference)
    for index, (name, unit) in enumerate(zip(cause.names, cause.units, strict=True)):
        if np.isfinite(change.values[index]):
            result.append(FoundParameter(name, *_number(change, index), unit))
    return tuple(result)


def _constant_parameters(model: Model, change: NamedChange, reference: State) -> tuple[FoundParameter, ...]:
    """Relative change of the constant, and where it was estimated its new value."""
    value, std = _number(change, 0)
    index = model.robot.joint_names.index(change.hypothesis.joint or "")
    if change.hypothesis.names == ("e",):  # share of today's torque under the old constant that is too much
        return (FoundParameter("e", -value, std, ""),)
    before = float(reference.values[len(model.parameters) + index])
    return (
        FoundParameter("e", value / before, std / before, ""),
        FoundParameter("torque_constant", before + value, std, "N.m/A"),
    )


def _said(parameters: tuple[FoundParameter, ...]) -> str:
    return ", ".join(f"{p.name.replace('_', ' ')} {'+' if p.value > 0 else ''}{rounded(p.value, p.std)} {p.unit}" for p in parameters)


def _place(joint: str | None) -> str:
    return "The robot" if joint is None else joint[0].upper() + joint[1:].replace("_", " ")


def _sentence(model: Model, change: NamedChange, parameters: tuple[FoundParameter, ...], reference: State) -> str:
    cause, place = change.hypothesis, _place(change.hypothesis.joint)
    if cause.effect == "payload":
        return _payload_sentence(model, change)
    if cause.effect == "torque_constant_error":
        share, std = 100 * parameters[0].value, 100 * (parameters[0].std or 0.0)
        weaker = "weaker: a demagnetised or swapped motor" if share < 0 else "stronger: a swapped motor or another current scale"
        return f"{place}'s torque constant is {share:+.1f} % ± {std:.1f} % from the reference's, {weaker}."
    if cause.effect == "friction_change":
        more = "more" if sum(p.value for p in parameters) > 0 else "less"
        wear = "a worn or dragging brake, old grease" if more == "more" else "a brake that no longer drags, warm or new grease"
        return f"{place} rubs {more} than in the reference: {_said(parameters)} ({wear})."
    if cause.effect == "rotor_inertia":
        return f"{place}'s rotor inertia has changed: {_said(parameters)} (another motor, brake or coupling)."
    if cause.effect == "gravity_compensation_spring":
        return f"{place}'s gravity compensation has changed: {_said(parameters)} (a slack, broken or readjusted spring)."
    return f"{place}'s constant torque has changed: {_said(parameters)} (current offset, or a preload)."


def _payload_sentence(model: Model, change: NamedChange) -> str:
    names = list(change.hypothesis.names)
    fixed = {name: _number(change, k) for k, name in enumerate(names) if np.isfinite(change.values[k])}
    link = model.robot.link_names[-1]
    lost = [name for name in names if name not in fixed]
    unknown = f" Not identifiable from these runs: {', '.join(lost)} of {link}." if lost else ""
    if "m" not in fixed:
        moments = ", ".join(f"{name} {rounded(*fixed[name])} kg.m" for name in ("mx", "my", "mz") if name in fixed)
        return f"The last link carries another load than in the reference; its mass cannot be told, its first moments can: {moments or 'none of them'}.{unknown}"
    mass, std = fixed["m"]
    what = "carries a load that the reference did not" if mass > 0 else "has lost a load that the reference carried"
    centre = _centre(change, names, mass)
    return f"The last link {what}: {rounded(abs(mass), std)} kg{centre} in the frame of {link}.{unknown}"


def _centre(change: NamedChange, names: list[str], mass: float) -> str:
    """Centre of mass of the load with its std, where its moments are known."""
    parts = []
    for axis in ("mx", "my", "mz"):
        k, m = names.index(axis), names.index("m")
        if not np.isfinite(change.values[k]):
            continue
        place = change.values[k] / mass
        slope = np.array([1.0, -place]) / mass
        std = float(np.sqrt(slope @ change.covariance[np.ix_([k, m], [k, m])] @ slope))
        parts.append(f"{axis[1]} = {rounded(float(place), std)} m")
    return f", its centre of mass at {', '.join(parts)}" if parts else ""
