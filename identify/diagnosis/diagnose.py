"""The whole chain: locate, name, model, show, and say what could not be seen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from identify.blocks import residual
from identify.dataset import Dataset
from identify.diagnosis.adequacy import Adequacy, examine
from identify.diagnosis.augmented import Augmented, fit_jointly
from identify.diagnosis.between import ForeignTone, Progress, foreign_tones, pick_progress
from identify.diagnosis.blind_spots import blind_spots, place_name
from identify.diagnosis.candidates import all_trials, at_an_end, best_by_place, log_chance
from identify.diagnosis.describe import (
    carrying_channels,
    contribution,
    parameters_of,
    readable_place,
    sentence_of,
    where_of,
)
from identify.diagnosis.findings import (
    ChannelFit,
    Diagnosis,
    Finding,
    FoundParameter,
    Unexplained,
    Where,
    rounded,
)
from identify.diagnosis.held_out import held_out
from identify.diagnosis.locate import locate
from identify.diagnosis.next_experiment import next_experiment
from identify.diagnosis.problem import Problem, build_problem
from identify.diagnosis.select import Named, Selection, backward, rebased, select
from identify.fit import Fit
from identify.physics.catalogue import catalogue
from identify.rotations import FloatArray

# family-wise levels; together the chance that a recording of the model plus noise raises any alarm is 1 %
LEVEL_NAMED = 0.006
LEVEL_REST = 0.002
LEVEL_PROGRESS = 0.001
LEVEL_CONSTANT = 0.001
# a name stands only where what it leaves on its own channels is small against what it explains
_LEFTOVER = 0.10
_SEED = 20240229  # the diagnosis of a recording must not change from run to run


@dataclass(frozen=True)
class DiagnoseOptions:
    """How to diagnose.

    Attributes:
        effects: names of the effects to consider; None takes the whole catalogue.
        level: multiplies all significance levels; 1 gives 1 % false alarms a recording.
    """

    effects: tuple[str, ...] | None = None
    level: float = 1.0


def diagnose(fit: Fit, other: Dataset | None = None, options: DiagnoseOptions | None = None) -> Diagnosis:
    """Find the physics that a fit lacks.

    Args:
        fit: the fit of the run.
        other: a recording not used in the fit.
        options: effects and levels.

    Returns:
        The diagnosis.
    """
    options = options or DiagnoseOptions()
    rng = np.random.default_rng(_SEED)
    effects = [e for e in catalogue().values() if options.effects is None or e.name in options.effects]
    problem = build_problem(fit)
    progress = pick_progress(problem, effects, LEVEL_PROGRESS * options.level)
    if progress:
        problem = replace(problem, extra=np.hstack([item.mean_columns(problem) for item, _ in progress]))
    selection = backward(problem, select(problem, effects, LEVEL_NAMED * options.level, rng), LEVEL_NAMED * options.level)
    selection, rest = _gate(problem, selection, options)
    augmented, renewed = fit_jointly(problem, [item.trial for item in selection.named])
    if not fit.replicated:
        firm = [n for n, a in zip(selection.named, augmented.additions, strict=True) if not at_an_end(a.effect, a.shape)]
        if len(firm) < len(selection.named):
            selection = rebased(problem, selection, firm)
            augmented, renewed = fit_jointly(problem, [item.trial for item in firm])
    shown = held_out(fit, augmented, other, rng) if other is not None else None
    findings = _findings(renewed, selection, augmented)
    drifting = {item.place.joint for item, _ in progress if item.effect.name == "torque_constant_drift"}
    constants = _constant_findings(problem, augmented, rest, LEVEL_CONSTANT * options.level)
    findings += tuple(c for c in constants if fit.model.robot.joint_names.index(c.joint) not in drifting)
    known = {(f.effect, f.joint, f.channel) for f in findings}
    changing = [_progress_finding(problem, item, rivals) for item, rivals in progress]
    findings += tuple(f for f in changing if (f.effect, f.joint, f.channel) not in known)
    tones = foreign_tones(problem)
    unexplained = _unexplained(problem, rest, tones, options, bool(findings))
    spots = blind_spots(problem, effects, selection.first, selection.null, LEVEL_NAMED * options.level)
    return Diagnosis(
        _verdict(findings, unexplained, fit),
        findings,
        unexplained,
        tuple(spots),
        _training(fit, renewed, augmented),
        shown,
        locate(fit),
        next_experiment(findings, unexplained),
        rest.structures,
        _warnings(fit),
        {"augmented": augmented, "progress": tuple(item for item, _ in progress), "problem": problem, "renewed": renewed},
    )


def _warnings(fit: Fit) -> tuple[str, ...]:
    return tuple(w for w in fit.warnings if not w.startswith("The model does not fit"))


def _gate(problem: Problem, selection: Selection, options: DiagnoseOptions) -> tuple[Selection, Adequacy]:
    """Take back names that leave too much on their own channels, and those that then no longer stand out."""
    if not problem.fit.replicated:
        return selection, Adequacy(1.0, {}, (), {})  # without replicates nothing says what noise would leave
    level = LEVEL_REST * options.level
    rest = examine(problem, selection.basis, selection.residual)
    while True:
        kept = [item for item in selection.named if not _leaves_too_much(problem, item, rest, level)]
        if len(kept) == len(selection.named):
            return selection, rest
        selection = backward(problem, rebased(problem, selection, kept), LEVEL_NAMED * options.level)
        rest = examine(problem, selection.basis, selection.residual)


def _leaves_too_much(problem: Problem, item: Named, rest: Adequacy, level: float) -> bool:
    trial = item.trial
    home = carrying_channels(problem, contribution(problem, trial))
    left = [s.gain - s.width for s in rest.structures if s.p_value < level and s.channel in home]
    left += [rest.excess[c] for c, p in rest.channel_p.items() if p < level / len(rest.channel_p) and c in home]
    return bool(left) and max(left) > _LEFTOVER * trial.gain


def _findings(problem: Problem, selection: Selection, augmented: Augmented) -> tuple[Finding, ...]:
    result = []
    for named, item in zip(selection.named, augmented.additions, strict=True):
        parameters = parameters_of(problem, item)
        alternatives = tuple(dict.fromkeys(r.effect.name for r in named.rivals if r.effect.name != item.effect.name))[:4]
        p = selection.null.p_value(float(log_chance(np.array(max(item.delta_chi2, 0.0)), max(item.freedom, 1))))
        joint = problem.scene.robot.joints[item.place.joint].name if item.place.joint is not None else None
        result.append(
            Finding(
                item.effect.name, joint, item.place.channel, parameters, max(p, 1e-300), item.delta_chi2, alternatives,
                where_of(problem, item), sentence_of(problem, item, parameters),
            )
        )
    return tuple(result)


def _constant_findings(problem: Problem, augmented: Augmented, rest: Adequacy, level: float) -> tuple[Finding, ...]:
    """Torque constants that differ from the robot file, where they were estimated and their joint is clean."""
    fit, result = problem.fit, []
    count = len(fit.model.parameters)
    free = fit.solution.free_scales
    dirty = {s.channel for s in rest.structures if s.p_value < LEVEL_REST}
    for column, joint in enumerate(free):
        drive, name = fit.model.robot.joints[joint].drive, fit.model.robot.joints[joint].name
        if drive.torque_constant is None or name in dirty or not fit.solution.identifiable[count + column]:
            continue
        scale, std = augmented.scale[joint], float(np.sqrt(augmented.baseline_covariance[count + column, count + column]))
        z = (scale - 1.0) / std
        p = float(min(1.0, len(free) * 2.0 * stats.norm.sf(abs(z))))
        if p <= level:
            rivals = _constant_rivals(problem, count + column, joint, float(z**2))
            result.append(_constant_finding(name, drive.torque_constant, scale, std, p, rivals))
    return tuple(result)


def _constant_rivals(problem: Problem, column: int, joint: int, gain: float) -> tuple[str, ...]:
    """Effects of that joint that would explain the same if its torque constant were the robot file's."""
    held = Problem(problem.fit, problem.scenes, problem.extra, column)
    effects = [e for e in catalogue().values() if e.where in ("I", "B")]
    trials = all_trials(held, held.basis, held.residual, effects, {})
    near = [t for t in best_by_place(trials) if t.place.joint == joint and t.penalised > gain - np.log(len(held.residual)) - 6.0]
    return tuple(dict.fromkeys(t.effect.name for t in sorted(near, key=lambda t: -t.penalised)))[:4]


def _constant_finding(name: str, nominal: float, scale: float, std: float, p: float, rivals: tuple[str, ...]) -> Finding:
    value, value_std = 1.0 / scale - 1.0, std / scale**2
    sentence = (
        f"{readable_place(name)}'s torque constant is {nominal / scale:.4g} N.m/A, {100 * value:+.1f} % ± {100 * value_std:.1f} % "
        f"from the robot file's {nominal:.4g} N.m/A."
    )
    parameters = (
        FoundParameter("e", value, value_std, "1"),
        FoundParameter("torque_constant", nominal / scale, nominal * value_std, "N.m/A"),
    )
    gain = float(((scale - 1.0) / std) ** 2)
    where = Where((name,), "the whole motion", ())
    return Finding("torque_constant_error", name, None, parameters, max(p, 1e-300), gain, rivals, where, sentence)


def _progress_finding(problem: Problem, item: Progress, rivals: tuple[str, ...]) -> Finding:
    parameters = _progress_parameters(item)
    joint = problem.scene.robot.joints[item.place.joint].name if item.place.joint is not None else None
    place = place_name(problem, item.place)
    course = "steadily over the run" if item.course == "ramp" else f"settling within about {item.time_constant_s:.3g} s"
    numbers = ", ".join(f"{p.name} {rounded(p.value, p.std)} {p.unit}" for p in parameters if p.name != "time_constant")
    return Finding(
        item.effect.name, joint, item.place.channel, parameters, max(item.p_value, 1e-300), item.gain, rivals,
        Where(item.channels(problem), "changing from period to period", ()),
        f"{readable_place(place)}: {item.effect.name.replace('_', ' ')}, {course}: {numbers}.",
    )


def _progress_parameters(item: Progress) -> tuple[FoundParameter, ...]:
    """What changes by how much; of an effect that only dies out, its pace."""
    if item.effect.settling is not None:
        assert item.time_constant_s is not None
        name, unit = item.effect.coefficients[0].name, item.effect.unit
        return (FoundParameter(name, 1.0 / item.time_constant_s, None, unit),)
    result = [
        FoundParameter(c.name, float(value), float(std), f"{c.unit}/s" if item.course == "ramp" else c.unit)
        for c, value, std in zip(item.effect.coefficients, item.values, item.std, strict=True)
    ]
    if item.time_constant_s is not None:
        result.append(FoundParameter("time_constant", item.time_constant_s, None, "s"))
    return tuple(result)


def _unjudged(problem: Problem) -> Unexplained:
    """Without replicates a name may stand, but nothing says whether the rest is noise."""
    channels = tuple(channel for block in problem.blocks for channel in block.channels)
    return Unexplained(
        channels, (), 1.0,
        "The run does not repeat, so nothing tells whether what is left is noise or more physics; the names above are those that "
        "fit best and may be wrong. Record whole periods to judge them.",
    )


def _unexplained(
    problem: Problem, rest: Adequacy, tones: list[ForeignTone], options: DiagnoseOptions, named: bool
) -> Unexplained | None:
    level = LEVEL_REST * options.level
    if problem.fit.window is None:
        return _unjudged(problem) if named else None
    if rest.p_value > level and not tones:
        return None
    structures = [s for s in rest.structures if s.p_value < level]
    channels = dict.fromkeys([s.channel for s in structures])
    channels |= dict.fromkeys(c for c, p in rest.channel_p.items() if p < level / (10 * len(rest.channel_p)))
    channels |= dict.fromkeys(t.channel for t in tones)
    depends = list(dict.fromkeys(s.variable for s in structures if s.variable != "time"))[:4]
    depends += [f"frequency:{t.frequency_hz:.4g}Hz" for t in tones[:2]]
    p = min([rest.p_value] + [t.p_value for t in tones])
    what = f"depends on {', '.join(depends)}" if depends else "has no dependence on a single state"
    if tones:
        what += f"; a tone at {tones[0].frequency_hz:.4g} Hz that is no harmonic of the period stands in {tones[0].channel}"
    sentence = f"Something that the catalogue does not name is left in {', '.join(channels)}: it {what} (p = {p:.1e})."
    return Unexplained(tuple(channels), tuple(depends), max(p, 1e-300), sentence)


def _verdict(findings: tuple[Finding, ...], unexplained: Unexplained | None, fit: Fit) -> str:
    if unexplained is not None:
        return "partly_explained" if findings else "unexplained"
    return "explained" if findings else "consistent"


def _training(fit: Fit, renewed: Problem, augmented: Augmented) -> ChannelFit:
    """RMS of the averaged residual before and after, in N.m and N."""
    after, noise = {}, {}
    levels = fit.noise_std
    for index, block in enumerate(fit.rows.blocks):
        rest = residual(block, augmented.theta, augmented.scale) - _effects_on(renewed, augmented, index)
        for k, (channel, joint) in enumerate(zip(block.channels, block.joint, strict=True)):
            factor = abs(1.0 / augmented.scale[joint]) if joint >= 0 else 1.0
            used = block.usable[k]
            after[channel] = float(np.sqrt(np.mean(rest[k][used] ** 2)) * factor) if used.any() else 0.0
            noise[channel] = levels[channel] / float(np.sqrt(block.repeats))
    return ChannelFit(fit.residual_rms, after, noise)


def _effects_on(renewed: Problem, augmented: Augmented, index: int) -> FloatArray:
    """What the named effects add to one block's prediction, measurement units, (c, B)."""
    total = np.zeros(renewed.blocks[index].target.shape)
    for item in augmented.additions:
        columns = renewed.enter(index, item.effect.columns(renewed.scenes[index], item.place, item.shape))
        total += np.tensordot(columns, item.values, axes=([1], [0]))
    return total
