"""A fit and what it says of itself: kinds, constants, drift, misfit, poor motions."""

from dataclasses import replace

import numpy as np
import pytest

from identify.dataset import RunFacts, Signal
from identify.errors import ModelError, UnusableDataError
from identify.filters import AntiAliasFilter
from identify.fit import FitOptions, fit
from identify.free_motion import FreeOptions
from identify.validation import validate
from tests.identify import synthetic


@pytest.fixture(scope="module")
def run():
    return synthetic.noise_free(plate_clock=synthetic.Clock(ppm=40.0, phase_s=4e-3))


@pytest.fixture
def noisy(run):
    return synthetic.with_noise(run, np.random.default_rng(1))


def close(found, run, names=()):
    """Errors over stated std, for the parameters named or all."""
    z = (found.theta - run.theta) / found.std
    return z if not names else z[[found.model.index(name) for name in names]]


def test_a_noise_free_run_gives_the_truth(run):
    found = fit(run.model.robot, run.data, model=run.model)
    np.testing.assert_allclose(found.theta, run.theta, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose([k.value for k in found.torque_constants], run.constants, rtol=1e-8)


def test_noise_is_found_per_channel(run, noisy):
    noise = fit(run.model.robot, noisy, model=run.model).noise_std
    for name in run.model.robot.joint_names:
        assert noise[name] == pytest.approx(synthetic.JOINT_NOISE, rel=0.06)
    for channel, std in zip(("force.x", "force.z", "torque.z"), (3.0, 1.5, 1.0), strict=True):
        assert noise[channel] == pytest.approx(std, rel=0.06)


@pytest.mark.parametrize("kind", ["internal", "external"])
def test_without_both_halves_the_constants_are_unknown_with_the_reason(run, noisy, kind):
    found = fit(run.model.robot, noisy, FitOptions(kind=kind))
    assert [k.value for k in found.torque_constants] == [None, None]
    assert all(k.reason for k in found.torque_constants)
    assert all(k.nominal == 0.2 for k in found.torque_constants)
    assert found.lack_of_fit.p > 0.001


def test_combined_beats_both_halves_for_every_parameter(run, noisy):
    options = {
        kind: FitOptions(kind=kind, nominal_constants=True) for kind in ("combined", "internal", "external")
    }
    exact = replace(noisy, current=Signal(noisy.current.t_s, noisy.current.values / run.scale[:, None]))
    fits = {kind: fit(run.model.robot, exact, option) for kind, option in options.items()}
    std = {
        kind: dict(zip([p.name for p in f.model.parameters], f.std, strict=True)) for kind, f in fits.items()
    }
    for kind in ("internal", "external"):
        shared = [name for name in std[kind] if name in std["combined"]]
        assert len(shared) > 5
        for name in shared:
            assert std["combined"][name] < 1.02 * std[kind][name], name


def test_efforts_instead_of_currents_leave_no_constants(run, noisy):
    factor = np.array([j.drive.gear_ratio * j.drive.torque_constant for j in run.model.robot.joints])
    torque = noisy.current.values * factor[:, None] / run.scale[:, None]
    data = replace(noisy, current=None, effort=Signal(noisy.current.t_s, torque))
    found = fit(run.model.robot, data, model=run.model)
    assert "efforts instead of" in found.torque_constants[0].reason
    assert np.abs(close(found, run)).max() < 4.5


def test_neither_current_nor_effort_is_refused(run, noisy):
    with pytest.raises(UnusableDataError, match="neither motor currents nor joint efforts"):
        fit(run.model.robot, replace(noisy, current=None), FitOptions(kind="internal"))


def test_a_run_without_wrench_is_refused_where_the_plate_is_asked_for(run, noisy):
    with pytest.raises(UnusableDataError, match="no force-plate wrench"):
        fit(run.model.robot, replace(noisy, wrench=None), FitOptions(kind="combined"))
    assert fit(run.model.robot, replace(noisy, wrench=None)).model.kind == "internal"


def test_drift_is_noticed_and_named(run, noisy):
    assert not any("drifts" in text for text in fit(run.model.robot, noisy, model=run.model).warnings)
    values = noisy.wrench.values.copy()
    values[2] += 0.1 * noisy.wrench.t_s
    found = fit(run.model.robot, replace(noisy, wrench=Signal(noisy.wrench.t_s, values)), model=run.model)
    texts = [text for text in found.warnings if "drifts" in text]
    assert len(texts) == 1
    assert "force.z" in texts[0]


def test_a_misfit_is_flagged_and_the_intervals_widen(run, noisy):
    speed = run.motion(noisy.current.t_s)[1]
    factor = np.array([j.drive.gear_ratio * j.drive.torque_constant for j in run.model.robot.joints])[:, None]
    extra = 6.0 * np.sign(speed) * np.exp(-((speed / 0.2) ** 2)) / factor
    wrong = replace(noisy, current=Signal(noisy.current.t_s, noisy.current.values + extra))
    found = fit(run.model.robot, wrong, model=run.model)
    plain = np.sqrt(np.diag(found.solution.covariance))[: len(run.theta)]
    assert found.lack_of_fit.p < 1e-6
    assert not found.intervals_valid
    assert any("does not fit" in text for text in found.warnings)
    index = [found.model.index(name) for name in ("j0.coulomb", "j0.viscous", "j1.coulomb", "j1.viscous")]
    assert (found.std[index] > 2.0 * plain[index]).all()
    # the wrong plain intervals are many std off; the widened ones are not
    assert np.abs((found.theta - run.theta)[index] / plain[index]).max() > 8.0
    assert np.abs(close(found, run)[index]).max() < 4.0


def test_an_unexcited_joint_is_named_and_its_parameters_are_infinite(run):
    motion = synthetic.fourier_motion(2)
    still = replace(motion, cosine=motion.cosine * [[1], [0]], sine=motion.sine * [[1], [0]])
    frozen = synthetic.noise_free(motion=still)
    found = fit(
        frozen.model.robot, synthetic.with_noise(frozen, np.random.default_rng(0)), model=frozen.model
    )
    assert any("j1 does not move" in text for text in found.warnings)
    assert any("std inf" in text and "j1.viscous" in text for text in found.warnings)
    assert found.std[found.model.index("j1.viscous")] == np.inf
    assert np.isnan(found.theta[found.model.index("j1.viscous")])
    seen = found.model.index("j0.viscous")
    assert abs(found.theta[seen] - frozen.theta[seen]) < 4 * found.std[seen]


def test_proportional_joints_are_warned_of():
    motion = synthetic.fourier_motion(2)
    tied = replace(
        motion, cosine=motion.cosine[[0, 0]] * [[1], [0.7]], sine=motion.sine[[0, 0]] * [[1], [0.7]]
    )
    found = fit(
        (run := synthetic.noise_free(motion=tied)).model.robot,
        synthetic.with_noise(run, np.random.default_rng(0)),
    )
    assert any("in proportion to each other" in text for text in found.warnings)


def test_a_retraced_curve_is_warned_of_and_a_rich_motion_is_not(run, noisy):
    motion = synthetic.fourier_motion(2)
    back_and_forth = replace(motion, sine=0.0 * motion.sine)
    curve = synthetic.noise_free(motion=back_and_forth)
    found = fit(curve.model.robot, synthetic.with_noise(curve, np.random.default_rng(0)))
    assert any("along its own path" in text for text in found.warnings)
    rich = fit(run.model.robot, noisy, model=run.model)
    assert not any("path" in text or "proportion" in text for text in rich.warnings)


def test_an_anti_alias_filter_stated_is_undone(run):
    anti_alias, data = AntiAliasFilter(order=4, cutoff_hz=8.0), run.data
    late = replace(data, wrench=Signal(data.wrench.t_s, anti_alias.apply_periodic(data.wrench.values, 32.0)))
    plain = synthetic.noise_free()
    late = replace(
        plain.data,
        wrench=Signal(plain.data.wrench.t_s, anti_alias.apply_periodic(plain.data.wrench.values, 32.0)),
    )
    noisy = synthetic.with_noise(replace(plain, data=late), np.random.default_rng(2))
    ignored = fit(plain.model.robot, noisy, model=plain.model)
    stated = fit(plain.model.robot, replace(noisy, filters={"wrench": anti_alias}), model=plain.model)
    assert ignored.lack_of_fit.p < 1e-6
    assert stated.lack_of_fit.p > 1e-3
    assert np.abs(close(stated, plain)).max() < 4.5


def test_a_run_treated_as_non_periodic_claims_no_replicates(run, noisy):
    free = FreeOptions(bandwidth_hz=8.0, decimate=2)
    found = fit(run.model.robot, noisy, FitOptions(periodic=False, free=free), model=run.model)
    assert found.lack_of_fit.p is None
    assert "no replicates" in found.lack_of_fit.reason
    assert not found.intervals_valid
    assert any("no replicate noise exists" in text for text in found.warnings)
    assert np.abs(close(found, run)).max() < 5.0


def test_maximum_likelihood_needs_a_period(run, noisy):
    with pytest.raises(ModelError, match="needs a periodic run"):
        fit(run.model.robot, noisy, FitOptions(periodic=False, estimator="ml"))


def test_unknown_estimators_are_refused(run, noisy):
    with pytest.raises(ModelError, match="choose markov, ols or ml"):
        fit(run.model.robot, noisy, FitOptions(estimator="kalman"))


def test_another_run_is_predicted_to_its_noise(run, noisy):
    other = synthetic.noise_free(motion=synthetic.fourier_motion(2, seed=9), seed=1)
    held_out = synthetic.with_noise(other, np.random.default_rng(8))
    held_out = replace(held_out, facts=RunFacts(), kind="validation")
    found = fit(run.model.robot, noisy, model=run.model)
    prediction = validate(found, held_out)
    assert set(prediction.rms) == set(run.model.channels)
    for item in prediction.channels:
        assert item.rms == pytest.approx(item.noise_std, rel=0.08), item.channel
        assert item.scored.mean() > 0.6
