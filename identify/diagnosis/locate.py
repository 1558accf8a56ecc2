"""Where does the mismatch sit? Internal alone, external alone, do they agree, which channels, one common force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from identify.errors import IdentifyError
from identify.fit import Fit, FitOptions, fit

_LEVEL = 0.01


@dataclass(frozen=True)
class Location:
    """First question of every diagnosis.

    Attributes:
        internal_p: lack of fit of the internal model alone, None where there is none.
        external_p: of the external model alone.
        agreement_p: Wald test that both find the same shared parameters.
        verdict: what the pattern means, in words.
    """

    internal_p: float | None
    external_p: float | None
    agreement_p: float | None
    verdict: str


def _wald(internal: Fit, external: Fit) -> float | None:
    """Probability that the shared parameters differ this much by noise alone."""
    names_i = [p.name for p in internal.model.parameters]
    shared = [
        (names_i.index(p.name), k)
        for k, p in enumerate(external.model.parameters)
        if p.name in names_i and dict(internal.model.parameters[names_i.index(p.name)].definition) == dict(p.definition)
    ]
    shared = [(i, e) for i, e in shared if np.isfinite(internal.std[i]) and np.isfinite(external.std[e])]
    if not shared:
        return None
    i, e = (list(index) for index in zip(*shared, strict=True))
    difference = internal.theta[i] - external.theta[e]
    covariance = internal.solution.covariance[np.ix_(i, i)] + external.solution.covariance[np.ix_(e, e)]
    statistic = float(difference @ np.linalg.solve(covariance, difference))
    return float(stats.chi2.sf(statistic, len(shared)))


def _meaning(internal: float | None, external: float | None, agreement: float | None) -> str:
    bad_i = internal is not None and internal < _LEVEL
    bad_e = external is not None and external < _LEVEL
    apart = agreement is not None and agreement < _LEVEL
    if internal is None and external is None:
        return "the recording does not repeat, so the two models cannot be judged against replicate noise"
    if external is None:
        return "misfit in the joints" if bad_i else "no misfit in the joints; without a force plate nothing more can be said"
    if bad_i and bad_e:
        return "both models misfit: a force from outside, or the motion is not what the encoders say"
    if bad_i:
        return "only the joints misfit: friction, drive electronics, cogging or current timing inside a joint"
    if bad_e:
        return "only the plate misfits: its gain, crosstalk, origin, high-pass, drift or timing"
    if apart:
        return "each model fits alone but they disagree: a torque constant, rotor inertia, spring or plate gain hides in the parameters"
    return "both models fit and agree: nothing that this excitation can show by the omnibus tests"


def locate(result: Fit) -> Location:
    """Compare the internal and the external model of a combined fit.

    Args:
        result: the fit of the richest model.

    Returns:
        The location; the omnibus tests are weak, a directed test may still find more.
    """
    options = FitOptions(periodic=result.window is not None)
    alone: dict[str, Fit | None] = {}
    for kind in ("internal", "external"):
        try:
            alone[kind] = (
                result
                if result.model.kind == kind
                else fit(result.model.robot, result.data, FitOptions(kind=kind, periodic=options.periodic))
                if result.model.kind == "combined"
                else None
            )
        except IdentifyError:
            alone[kind] = None
    internal, external = alone["internal"], alone["external"]
    agreement = _wald(internal, external) if internal is not None and external is not None else None
    p_i = internal.lack_of_fit.p if internal is not None else None
    p_e = external.lack_of_fit.p if external is not None else None
    return Location(p_i, p_e, agreement, _meaning(p_i, p_e, agreement))
