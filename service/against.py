"""A diagnosis against an earlier calibration: what has changed on the robot since."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from identify.diagnosis.augmented import Augmented
from identify.diagnosis.augmented_fit import augmented_fit
from identify.diagnosis.change import LEVEL_CHANGE, Comparison, State, compare
from identify.diagnosis.change_words import change_finding
from identify.diagnosis.findings import Diagnosis, Finding, Unexplained
from identify.diagnosis.hypotheses import hypotheses_of
from identify.diagnosis.problem import Problem
from identify.fit import Fit, FitOptions
from identify.model import Model
from service.errors import EstimateError
from service.estimate_reading import Estimate
from service.robots import LoadedRobot

_SAME = 1e-6  # relative difference of definitions that rounding may make


def suitable(reference: Estimate, loaded: LoadedRobot, options: FitOptions, has_wrench: bool) -> FitOptions:
    """Check that a reference is of this robot; make the new fit of the reference's kind.

    Args:
        reference: the earlier estimate.
        loaded: the robot of the new run.
        options: how the new run was to be fitted.
        has_wrench: whether the new run has a wrench.

    Returns:
        The options, their kind that of the reference.

    Raises:
        EstimateError: another robot, other parameters, or a kind that this run cannot give.
    """
    there, here = reference.loaded.robot, loaded.robot
    if there.joint_names != here.joint_names or reference.loaded.name != loaded.name:
        raise EstimateError(
            f"{reference.source} is an estimate of robot '{reference.loaded.name}' with joints {', '.join(there.joint_names)}, but this run "
            f"is one of '{loaded.name}' with {', '.join(here.joint_names)}; give an earlier estimate of the same robot."
        )
    kind = reference.model.kind
    if options.kind not in (None, kind):
        raise EstimateError(f"{reference.source} is of the {kind} model, so it cannot be compared with the {options.kind} model asked for; leave --model out.")
    if kind != "internal" and not has_wrench:
        raise EstimateError(
            f"{reference.source} is of the {kind} model, which has parameters that this run without a wrench does not show; "
            "give an internal estimate, or record with the force plate."
        )
    return replace(options, kind=kind)


def _same_parameters(reference: Estimate, model: Model) -> None:
    mine, theirs = model.parameters, reference.model.parameters
    names, other = [p.name for p in mine], [p.name for p in theirs]
    if names != other:
        odd = next(iter(set(names) ^ set(other)), "their order")
        raise EstimateError(
            f"{reference.source} has other parameters than the model of this run ({odd}): friction terms, compensation or geometry were "
            "described differently; identify the reference's run again with today's robot file."
        )
    for a, b in zip(mine, theirs, strict=True):
        keys = set(a.definition) | set(b.definition)
        if any(abs(a.definition.get(k, 0.0) - b.definition.get(k, 0.0)) > _SAME * (1.0 + abs(b.definition.get(k, 0.0))) for k in keys):
            raise EstimateError(
                f"{reference.source} defines {a.name} by another geometry than today's robot file; identify the reference's run again with it."
            )


def _drives_differ(reference: Estimate, loaded: LoadedRobot) -> None:
    """Gear ratios and, where constants are not estimated, nominal constants scale what is compared."""
    for mine, theirs in zip(loaded.robot.joints, reference.loaded.robot.joints, strict=True):
        a, b = mine.drive, theirs.drive
        estimated = reference.model.kind == "combined" and np.isfinite(reference.torque_constants).all()
        if a.gear_ratio != b.gear_ratio or a.rotor_inertia != b.rotor_inertia or (a.torque_constant != b.torque_constant and not estimated):
            raise EstimateError(
                f"{reference.source} was made with another gear ratio, rotor inertia or nominal torque constant of {mine.name} than today's "
                "robot file states; identify the reference's run again with it."
            )


def _state(fit: Fit) -> State:
    constants = [np.nan if k.value is None else k.value for k in fit.torque_constants]
    return State(np.concatenate([fit.theta, constants]), fit.covariance)


def against_estimate(
    diagnosis: Diagnosis, fit: Fit, loaded: LoadedRobot, reference: Estimate
) -> tuple[Diagnosis, dict[str, Any]]:
    """Name what has changed since the reference and add it to a diagnosis.

    Args:
        diagnosis: of the new run.
        fit: its baseline.
        loaded: the robot.
        reference: the earlier estimate, of the same kind.

    Returns:
        The diagnosis with the changes among its findings, and the content of ``against``.

    Raises:
        EstimateError: the reference has other parameters.
    """
    _same_parameters(reference, fit.model)
    _drives_differ(reference, loaded)
    problem, augmented = diagnosis.model["problem"], diagnosis.model["augmented"]
    assert isinstance(problem, Problem)
    assert isinstance(augmented, Augmented)
    joint = augmented_fit(fit, augmented, diagnosis.unexplained is None).fit if _clean(reference) else fit
    now = _state(joint)
    before = State(np.concatenate([reference.theta, reference.torque_constants]), reference.covariance)
    rows = int(sum(block.rows for block in fit.rows.blocks))
    found = compare(fit.model, now, before, hypotheses_of(problem), rows)
    changes = tuple(change_finding(fit.model, change, now, before) for change in found.changes)
    return _merged(diagnosis, changes, found, fit.model, reference), _content(found, changes, fit.model, now, before, reference)


def _clean(reference: Estimate) -> bool:
    """Whether the reference itself fitted its run: only then is a new effect no old one."""
    return bool(reference.content.get("intervals_valid", False)) or bool(reference.content.get("effects"))


def _merged(
    diagnosis: Diagnosis, changes: tuple[Finding, ...], found: Comparison, model: Model, reference: Estimate
) -> Diagnosis:
    """Changes join the findings; a constant off the robot file that the reference knew of is no news."""
    known = {
        name for name, value in zip(model.robot.joint_names, reference.torque_constants, strict=True) if np.isfinite(value)
    }
    old = tuple(
        f for f in diagnosis.findings if not (f.effect == "torque_constant_error" and f.joint in known and "whole motion" in f.where.region)
    )
    findings, rest = old + changes, diagnosis.unexplained
    if rest is None and found.rest_p < LEVEL_CHANGE:
        rest = _rest(found, model)
    verdict = ("partly_explained" if findings else "unexplained") if rest else ("explained" if findings else "consistent")
    return replace(diagnosis, findings=findings, unexplained=rest, verdict=verdict)


def _rest(found: Comparison, model: Model) -> Unexplained:
    odd = [name for name, p in sorted(found.groups.items(), key=lambda item: item[1]) if p < LEVEL_CHANGE][:4]
    which = ", ".join(name.replace("_", " ").replace(":", " of ") for name in odd) or "no single group of parameters"
    sentence = f"The parameters have changed since the reference in a way that no single cause explains; most in: {which} (p = {found.rest_p:.1e})."
    return Unexplained((), tuple(f"parameters:{name}" for name in odd), max(found.rest_p, 1e-300), sentence)


def _content(
    found: Comparison, changes: tuple[Finding, ...], model: Model, now: State, before: State, reference: Estimate
) -> dict[str, Any]:
    names = [p.name for p in model.parameters] + [f"{joint}.torque_constant" for joint in model.robot.joint_names]
    units = [p.unit for p in model.parameters] + ["N.m/A"] * model.robot.n
    std = np.sqrt(np.diag(found.difference.covariance))
    rows = [
        {
            "name": names[k], "unit": units[k], "reference": float(before.values[k]), "now": float(now.values[k]),
            "difference": float(d), "std": float(s), "z": float(d / s),
        }
        for k, d, s in zip(found.difference.used, found.difference.values, std, strict=True)
    ]
    if changes:
        sentence = "Since the reference: " + " ".join(item.sentence for item in changes)
    elif found.rest_p < LEVEL_CHANGE:
        sentence = "The parameters differ from the reference's beyond their uncertainty, but no single cause explains how."
    else:
        sentence = f"Nothing has changed since the reference beyond the uncertainty of both (p = {found.p_value:.2g})."
    return {
        "kind": "estimate",
        "reference": reference.source,
        "sentence": sentence,
        "p_value": found.p_value,
        "rest_p": found.rest_p,
        "changes": [{"effect": item.effect, "joint": item.joint, "p_value": item.p_value} for item in changes],
        "groups": found.groups,
        "parameters": rows,
        "simulated": reference.simulated,
    }
