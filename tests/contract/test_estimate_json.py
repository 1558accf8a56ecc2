"""``estimate.json`` as other programs read it: keys, orders, units, null with its reason."""

import json
import math

import numpy as np
import pytest

from tests.service import synthetic_logs as logs

KEYS = {
    "schema_version", "robot", "model", "simulated", "parameters", "covariance", "torque_constants",
    "counts", "noise", "lack_of_fit", "intervals_valid", "warnings", "rms", "condition_number",
}  # fmt: skip
WRENCH = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")
GROUPS = {"inertial", "friction", "offset", "gravity_compensation", "rotor", "plate"}
NAMES = {
    *(f"joint_{k}.{term}" for k in (1, 2, 3) for term in ("coulomb", "viscous", "offset")),
    *(f"joint_2.gravity_{wave}_{k}" for wave in ("cos", "sin") for k in (1, 2, 3)),
    *(f"plate.{channel}.offset" for channel in WRENCH),
}


def refuse(text):
    raise ValueError(f"{text} is no JSON")


@pytest.fixture(scope="module")
def estimates(tmp_path_factory):
    from service.cli.main import run

    folder = tmp_path_factory.mktemp("estimates")
    log, result = logs.write(logs.recording(), folder / "run.mcap"), {}
    for model in ("combined", "internal", "external"):
        path = folder / f"{model}.json"
        assert (
            run(["identify", str(log), "--robot", "ir361", "--model", model, "-o", str(path), "--json"]) == 0
        )
        result[model] = json.loads(path.read_text(), parse_constant=refuse)
    return result


@pytest.mark.parametrize("model", ["combined", "internal", "external"])
def test_keys_and_types(estimates, model):
    found = estimates[model]
    assert set(found) >= KEYS
    assert (found["schema_version"], found["robot"], found["model"], found["simulated"]) == (
        1,
        "ir361",
        model,
        True,
    )
    assert found["counts"] == {"internal": 28, "external": 19, "combined": 34}
    assert set(found["lack_of_fit"]) >= {"chi2", "dof", "p"}
    assert isinstance(found["intervals_valid"], bool)
    assert all(isinstance(text, str) for text in found["warnings"])
    assert set(found["rms"]) >= {"training"}


@pytest.mark.parametrize("model", ["combined", "internal", "external"])
def test_channels_are_named_by_joint_and_by_axis(estimates, model):
    expected = (logs.NAMES if model != "external" else ()) + (WRENCH if model != "internal" else ())
    assert tuple(estimates[model]["noise"]) == expected
    assert tuple(estimates[model]["rms"]["training"]) == expected


def test_parameter_names_are_those_of_the_contract(estimates):
    parameters = estimates["combined"]["parameters"]
    assert {p["group"] for p in parameters} <= GROUPS
    assert {p["name"] for p in parameters if p["group"] not in ("inertial", "rotor")} == NAMES
    for p in parameters:
        assert set(p) >= {"name", "group", "value", "std", "unit", "definition"}
        assert p["std"] > 0
        assert p["unit"]
    names = [p["name"] for p in parameters]
    assert len(set(names)) == len(names)


def test_inertial_parameters_carry_their_definition(estimates):
    known = {
        f"link_{k}.{name}"
        for k in (1, 2, 3)
        for name in ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
    }
    for p in estimates["combined"]["parameters"]:
        if p["group"] == "inertial":
            assert set(p["definition"]) <= known
            assert 1.0 in p["definition"].values()


@pytest.mark.parametrize("model", ["combined", "internal", "external"])
def test_covariance_is_in_the_order_of_parameters_then_constants(estimates, model):
    found = estimates[model]
    size = len(found["parameters"]) + 3
    table = np.array([[np.nan if x is None else x for x in row] for row in found["covariance"]])
    assert table.shape == (size, size)
    std = [p["std"] for p in found["parameters"]]
    np.testing.assert_allclose(np.sqrt(np.diag(table))[:-3], std, rtol=1e-9)
    if model == "combined":
        np.testing.assert_allclose(
            np.sqrt(np.diag(table))[-3:], [k["std"] for k in found["torque_constants"]], rtol=1e-9
        )
        assert np.linalg.eigvalsh(table / np.sqrt(np.outer(np.diag(table), np.diag(table)))).min() > -1e-9
    else:
        assert np.isnan(table[-3:]).all()


def test_constants_come_with_units_or_with_a_reason(estimates):
    for model, found in estimates.items():
        assert [k["joint"] for k in found["torque_constants"]] == list(logs.NAMES)
        for k in found["torque_constants"]:
            assert k["unit"] == "N.m/A"
            if model == "combined":
                assert math.isfinite(k["value"])
                assert math.isfinite(k["std"])
            else:
                assert k["value"] is None
                assert k["std"] is None
                assert k["reason"]
