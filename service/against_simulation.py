"""A diagnosis against another simulator's log: parameter error, named effects, rest."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from daq.recording import Recording
from identify.diagnosis.augmented import Augmented
from identify.diagnosis.augmented_fit import augmented_fit
from identify.diagnosis.change import State, compare
from identify.diagnosis.change_words import change_finding
from identify.diagnosis.decompose import Decomposition, decompose
from identify.diagnosis.findings import Diagnosis
from identify.diagnosis.hypotheses import hypotheses_of
from identify.diagnosis.problem import Problem
from identify.fit import Fit
from service.datasets import dataset_of
from service.errors import LogError
from service.robots import LoadedRobot


def against_simulation(diagnosis: Diagnosis, fit: Fit, loaded: LoadedRobot, simulation: Recording) -> dict[str, Any]:
    """Compare a diagnosed recording with a simulation of it.

    Args:
        diagnosis: of the recording.
        fit: its baseline.
        loaded: the robot.
        simulation: the simulator's log.

    Returns:
        The content of ``against``.

    Raises:
        LogError: the simulation lacks a topic or is of another robot.
    """
    data = dataset_of(simulation, loaded)
    if fit.model.kind != "internal" and data.wrench is None:
        raise LogError(
            f"{simulation.source} has no /force_plate/wrench to compare the {fit.model.kind} model with; "
            "let the simulator log it, or diagnose with --model internal."
        )
    if fit.model.kind != "external" and data.drive_signal is None:
        raise LogError(f"{simulation.source} has neither /motor_currents nor efforts to compare with; let the simulator log one of them.")
    problem, augmented = diagnosis.model.get("renewed", diagnosis.model["problem"]), diagnosis.model["augmented"]
    assert isinstance(problem, Problem)
    assert isinstance(augmented, Augmented)
    found = decompose(problem, augmented, data)
    now = augmented_fit(fit, augmented, diagnosis.unexplained is None).fit
    constants = [np.nan if k.value is None else k.value for k in now.torque_constants]
    here = State(np.concatenate([now.theta, constants]), now.covariance)
    there = State(np.concatenate([found.theta, found.torque_constants]), np.zeros_like(now.covariance))
    rows = int(sum(block.rows for block in fit.rows.blocks))
    compared = compare(fit.model, here, there, hypotheses_of(problem), rows)
    changes = [change_finding(fit.model, change, here, there) for change in compared.changes]
    effects = [item.effect.name for item in augmented.additions]
    return {
        "kind": "simulation",
        "reference": simulation.source,
        "simulated": True,
        "same_motion": found.same_motion,
        "sentence": _sentence(found, effects),
        "channels": {
            name: {
                "difference": s.difference, "parameters": s.parameters, "effects": s.effects, "rest": s.rest, "noise": s.noise,
                "shares": s.shares, "simulation_rest": s.simulation_rest,
            }
            for name, s in found.channels.items()
        },
        "effects": effects,
        "changes": [
            {"effect": c.effect, "joint": c.joint, "p_value": c.p_value, "sentence": _of_simulation(c.sentence)}
            for c in changes
        ],
        "p_value": compared.p_value,
        "parameters": _parameters(fit, here, there),
    }


def _of_simulation(sentence: str) -> str:
    """A simulator has no worn brakes: the guess at a cause is left out."""
    return re.sub(r" \([^()]*\)\.$", ".", sentence).replace("the reference", "the simulation")


def _parameters(fit: Fit, here: State, there: State) -> list[dict[str, Any]]:
    names = [p.name for p in fit.model.parameters] + [f"{j}.torque_constant" for j in fit.model.robot.joint_names]
    units = [p.unit for p in fit.model.parameters] + ["N.m/A"] * fit.model.robot.n
    plate = [p.group == "plate" for p in fit.model.parameters] + [False] * fit.model.robot.n
    rows = []
    for k, name in enumerate(names):
        std = float(np.sqrt(here.covariance[k, k]))
        if plate[k] or not np.isfinite([here.values[k], there.values[k], std]).all() or std == 0.0:
            continue
        d = float(here.values[k] - there.values[k])
        rows.append(
            {"name": name, "unit": units[k], "reference": float(there.values[k]), "now": float(here.values[k]), "difference": d, "std": std, "z": d / std}
        )
    return rows


def _sentence(found: Decomposition, effects: list[str]) -> str:
    worst = max(found.channels, key=lambda c: found.channels[c].difference / max(found.channels[c].noise, 1e-300))
    share = found.channels[worst]
    if share.difference < 1.1 * share.noise:
        return "Recording and simulation agree in every channel to the recording's noise."
    unit = "N" if worst.startswith("force") else "N.m"
    named = f"the named effects ({', '.join(e.replace('_', ' ') for e in effects)})" if effects else "named effects (there are none)"
    how = "sample by sample, both on the same motion" if found.same_motion else "through the model fitted to both, their motions differ"
    return (
        f"Recording less simulation is largest against its noise in {worst.replace('_', ' ')}: {share.difference:.3g} {unit} RMS (noise {share.noise:.2g}), "
        f"of whose power {100 * share.shares['parameters']:.0f} % is parameter error, {100 * share.shares['effects']:.0f} % {named}, "
        f"{100 * share.shares['noise']:.0f} % the recording's noise and {100 * share.shares['rest']:.0f} % a rest; compared {how}."
    )
