from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from identify.errors import ModelError
from identify.excitation import search
from identify.excitation.design import design, prepare
from identify.excitation.errors import DesignError
from identify.excitation.reference import reference_from_description
from identify.excitation.verify import verify


def test_beats_random_motions_and_one_drawn_by_hand(two_axes, quick, found):
    problem = prepare(two_axes, quick)
    rng = np.random.default_rng(0)
    others = [problem.value_of(problem.mapping.series(problem.mapping.random(rng))) for _ in range(200)]
    assert problem.value_of(found.series) < min(others)
    assert found.expected.log_det_covariance < found.plain.log_det_covariance


def test_keeps_every_limit_on_a_dense_grid_ramps_included(found):
    limits, ramp = found.limits, found.ramp
    t = np.linspace(0.0, ramp.duration_s, 20_001)
    parts = [found.series.evaluate(found.series.grid_s(50_021))]
    parts += [ramp.evaluate(found.series, t), ramp.evaluate_out(found.series, t)]
    for q, qd, qdd in parts:
        assert (q >= limits.lower[:, None]).all() and (q <= limits.upper[:, None]).all()
        assert (np.abs(qd) <= limits.velocity[:, None] + 1e-9).all()
        assert (np.abs(qdd) <= limits.acceleration[:, None] + 1e-9).all()


def test_ramps_start_and_stop_at_rest_and_meet_the_orbit_smoothly(found):
    ramp, series = found.ramp, found.series
    t = np.linspace(0.0, ramp.duration_s, 100_001)
    orbit = [part[:, 0] for part in series.evaluate(np.zeros(1))]
    for part, rest, meet in ((ramp.evaluate(series, t), 0, -1), (ramp.evaluate_out(series, t), -1, 0)):
        q, qd, qdd = part
        np.testing.assert_allclose(qd[:, rest], 0.0, atol=1e-12)
        np.testing.assert_allclose(qdd[:, rest], 0.0, atol=1e-12)
        for value, wanted in zip(part, orbit, strict=True):
            np.testing.assert_allclose(value[:, meet], wanted, atol=1e-9)
        np.testing.assert_allclose(np.gradient(q, t, axis=1)[:, 2:-2], qd[:, 2:-2], atol=1e-5)
        np.testing.assert_allclose(np.gradient(qd, t, axis=1)[:, 2:-2], qdd[:, 2:-2], atol=1e-4)


def test_same_seed_same_motion_however_it_is_spread(two_axes, quick, found):
    with ThreadPoolExecutor(2) as executor:
        spread = design(two_axes, quick, executor)
    other = design(two_axes, replace(quick, seed=1))
    for part in ("offset", "cosine", "sine"):
        np.testing.assert_array_equal(getattr(found.series, part), getattr(spread.series, part))
    assert not np.array_equal(found.series.cosine, other.series.cosine)


def test_torque_limit_binds(two_axes, quick, with_limits, found):
    free = found
    heavy = two_axes_with_bodies(two_axes)
    weak = with_limits(heavy, 1, effort=40.0)
    found = design(weak, quick)
    assert found.reference.source == "urdf"
    assert free.peaks.effort[1] > 40.0 >= found.peaks.effort[1]


def two_axes_with_bodies(robot):
    links = np.zeros((2, 10))
    links[:, 0], links[:, 3], links[:, [4, 7, 9]] = 8.0, 0.9, 0.4
    return replace(robot, reference_parameters=links)


@pytest.mark.parametrize(("criterion", "better"), [("a", "variance"), ("condition", "condition")])
def test_other_criteria_improve_what_they_name(two_axes, quick, criterion, better, found):
    by_d = found
    found = design(two_axes, replace(quick, criterion=criterion, warm_start=by_d.series))
    if better == "condition":
        assert found.expected.condition_number < by_d.expected.condition_number
    else:

        def total(d):
            return sum((d.expected.std[name] / d.plain.std[name]) ** 2 for name in d.expected.std)

        assert total(found) < total(by_d)


def test_discriminating_design_lowers_the_smallest_detectable_size(two_axes, quick):
    options = replace(quick, criterion="discriminating", effects=("stribeck_friction:pitch",))
    found = design(two_axes, options)
    (size,) = found.expected.smallest_detectable.values()
    (by_hand,) = found.plain.smallest_detectable.values()
    assert size < 0.8 * by_hand


def test_warm_start_is_never_lost(two_axes, quick, found):
    again = design(two_axes, replace(quick, seed=9, starts=1, warm_start=found.series))
    assert again.expected.log_det_covariance <= found.expected.log_det_covariance + 0.05


def test_interruption_keeps_the_best_so_far(two_axes, quick):
    seen = []

    def stop_after_two(progress):
        seen.append(progress.best)
        if progress.done == 2:
            raise KeyboardInterrupt

    found = design(two_axes, replace(quick, starts=6), progress=stop_after_two)
    assert found.interrupted and len(seen) == 2
    problem = prepare(two_axes, quick)
    assert problem.value_of(found.series) == pytest.approx(min(seen), abs=1e-3)


def test_interruption_inside_the_first_start_still_gives_a_motion(two_axes, quick, monkeypatch):
    calls = [0]
    evaluate = search.Problem.value_and_gradient

    def interrupted(self, *arguments):
        calls[0] += 1
        if calls[0] > 3:
            raise KeyboardInterrupt
        return evaluate(self, *arguments)

    monkeypatch.setattr(search.Problem, "value_and_gradient", interrupted)
    assert design(two_axes, quick).interrupted


def test_without_a_plate_torque_constants_are_no_unknowns(two_axes, quick):
    found = design(replace(two_axes, plate=None), quick)
    assert found.model == "internal"
    assert not any("torque_constant" in name for name in found.expected.std)


def test_verification_refuses_what_exceeds_a_limit(problem, found):
    grown = found.series.shrunk(1.05)
    with pytest.raises(DesignError, match="is the limit"):
        verify(problem.information, problem.mapping.limits, problem.workspace, grown, found.ramp)


def test_nominal_guess_is_stated(two_axes, problem):
    reference = reference_from_description(problem.information.model, problem.mapping.limits)
    assert reference.source == "nominal guess" and "no inertials" in reference.sentence


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"harmonics": 40, "rate_hz": 10.0}, "holds 50 samples at 10 Hz, but 40 harmonics need at least 160"),
        ({"harmonics": 0}, "0 harmonics"),
        ({"fundamental_hz": -0.1}, "-0.1 Hz"),
        ({"criterion": "e"}, "choose d, a, condition"),
        ({"criterion": "discriminating"}, "needs at least one effect"),
        ({"start_pose": (0.0, 1.2)}, "start position 1.2 of joint 'pitch' lies outside its limits -0.8 to 1"),
        ({"start_pose": (0.0,)}, "has 1 positions"),
        ({"share": 1.5}, "share of the limits is 1.5"),
        ({"noise": {"yaw": -1.0}}, "noise of channel 'yaw'"),
        ({"reference": {"yaw.coulomb": 1.0}, "reference_source": "e.json"}, "e.json lacks"),
        ({"criterion": "discriminating", "effects": ("stribeck_friction:elbow",)}, "no place 'elbow'"),
    ],
)
def test_bad_options_are_one_sentence_with_the_number(two_axes, quick, change, words):
    with pytest.raises(DesignError, match=words) as caught:
        design(two_axes, replace(quick, **change))
    assert "\n" not in str(caught.value)


def test_misspelt_effect_gets_a_suggestion(two_axes, quick):
    options = replace(quick, criterion="discriminating", effects=("stribek_friction:yaw",))
    with pytest.raises(ModelError, match="did you mean 'stribeck_friction'"):
        design(two_axes, options)


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"lower": 0.3, "upper": 0.3}, "may move over 0 rad"),
        ({"velocity": 0.0}, "velocity limit 0 rad/s"),
        ({"acceleration": -1.0}, "acceleration limit -0.99 rad/s2"),
        ({"effort": 0.0}, "effort limit 0 N.m"),
    ],
)
def test_limits_that_allow_no_motion(two_axes, quick, with_limits, limits, words):
    with pytest.raises(DesignError, match=words):
        design(with_limits(two_axes, 1, **limits), quick)


def test_too_weak_a_drive_names_its_torque(two_axes, quick, with_limits):
    robot = with_limits(two_axes_with_bodies(two_axes), 1, effort=1.0, lower=0.5)
    with pytest.raises(
        DesignError, match=r"torque of joint 'pitch' reaches .* N.m, but 0\.99 N.m is the limit"
    ):
        design(robot, quick)
