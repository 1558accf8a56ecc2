"""The sample logs of an independent simulator: what must come out of them."""

import json

import pytest

from tests.daq.logs import shared
from tests.service.synthetic_logs import command

pytestmark = pytest.mark.shared

SAMPLES = "ir361/samples"
FRICTION = {"viscous": (21.3, 18.46, 6.466), "coulomb": (41.2, 35.63, 14.196)}
OFFSETS = {"joint_1.offset": 1.7, "joint_3.offset": 0.8}  # joint 2's is shared with its gravity series
CONSTANTS = (0.215, 0.215, 0.155)


def estimate(capsys, name, *options):
    run, held_out = shared(f"{SAMPLES}/{name}.run.mcap"), shared(f"{SAMPLES}/{name}.validation.mcap")
    code, out, err = command(
        capsys, "identify", run, "--robot", "ir361", "--validate", held_out, "--json", *options
    )
    assert (code, err) == (0, "")
    return json.loads(out)


@pytest.fixture(scope="module")
def plain():
    from identify.fit import FitOptions
    from service.identification import identify_log

    run, held_out = shared(f"{SAMPLES}/plain.run.mcap"), shared(f"{SAMPLES}/plain.validation.mcap")
    return identify_log(run, "ir361", FitOptions(), held_out).content


def test_counts(plain):
    assert plain["counts"] == {"internal": 28, "external": 19, "combined": 34}


def test_friction_and_offsets_are_within_three_std(plain):
    found = {p["name"]: p for p in plain["parameters"]}
    for term, values in FRICTION.items():
        for k, value in enumerate(values):
            p = found[f"joint_{k + 1}.{term}"]
            assert abs(p["value"] - value) < 3 * p["std"], p["name"]
            assert p["std"] < 0.01 * value
    for name, value in OFFSETS.items():
        assert abs(found[name]["value"] - value) < 3 * found[name]["std"], name


def test_the_offset_of_the_compensated_joint_is_within_its_wide_interval(plain):
    p = next(p for p in plain["parameters"] if p["name"] == "joint_2.offset")
    assert abs(p["value"] + 2.3) < 3 * p["std"]
    assert any("joint_2.offset and joint_2.gravity_*" in text for text in plain["warnings"])


def test_torque_constants(plain):
    for k, value in zip(plain["torque_constants"], CONSTANTS, strict=True):
        assert abs(k["value"] - value) < 3 * k["std"]
        assert k["std"] < 0.005 * value


def test_the_model_fits(plain):
    assert 0.01 < plain["lack_of_fit"]["p"] < 0.99
    assert plain["intervals_valid"]
    assert plain["simulated"]


def test_validation_is_as_good_as_the_noise(plain):
    for joint in ("joint_1", "joint_2", "joint_3"):
        assert plain["rms"]["validation"][joint] == pytest.approx(plain["noise"][joint], rel=0.03)


@pytest.mark.parametrize(("model", "p"), [("internal", 0.01), ("external", 0.01)])
def test_the_halves_fit_too(capsys, model, p):
    found = estimate(capsys, "plain", "--model", model)
    assert p < found["lack_of_fit"]["p"] < 0.99


def test_stiction_outside_the_model_is_a_misfit_not_a_narrow_interval(capsys):
    found = estimate(capsys, "stribeck_joint_2")
    assert found["lack_of_fit"]["p"] < 0.01
    assert not found["intervals_valid"]
    assert any("does not fit" in text for text in found["warnings"])
    parameters = {p["name"]: p for p in found["parameters"]}
    for k, joint in enumerate(("joint_1", "joint_2", "joint_3")):
        p = parameters[f"{joint}.viscous"]
        assert abs(p["value"] - FRICTION["viscous"][k]) < 4 * p["std"], joint


def test_maximum_likelihood_agrees_with_markov_here(capsys, plain):
    """Encoders of 3e-5 rad are almost noiseless on this arm."""
    found = estimate(capsys, "plain", "--estimator", "ml")
    for ours, markov in zip(found["parameters"], plain["parameters"], strict=True):
        assert abs(ours["value"] - markov["value"]) < 0.5 * markov["std"], ours["name"]
    assert 0.01 < found["lack_of_fit"]["p"] < 0.99
