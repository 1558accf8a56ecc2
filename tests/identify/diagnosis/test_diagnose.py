"""The diagnosis on recordings of the independent virtual robot, where the truth is known."""

import functools

import numpy as np
import pytest

from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.plant_file import load_plant
from drivers.virtual.record import record_virtual
from drivers.virtual.robot_description import robot_attachments
from drivers.virtual.trajectories import random_fourier, random_points
from identify.diagnosis.diagnose import diagnose
from identify.fit import FitOptions, fit
from service.datasets import dataset_of
from service.robots import build_robot

SEED = 5


@functools.cache
def robot():
    files = robot_attachments(load_plant("ir361"))
    urdf = next(text for name, text in files.items() if name.endswith(".urdf"))
    return build_robot(files["robot.toml"].decode(), urdf.decode(), "ir361")


def recording(*effects, points=False, colour=0.0):
    plant = load_plant("ir361")
    plant = plant.model_copy(update={"noise": plant.noise.model_copy(update={"colour": colour})})
    trajectory = random_points(plant, SEED) if points else random_fourier(plant, SEED)
    return dataset_of(record_virtual(plant, trajectory, periods=6, seed=SEED + points, effects=effects), robot())


def diagnosis(*effects, held_out=False, colour=0.0, **options):
    result = fit(robot().robot, recording(*effects, colour=colour), FitOptions(**options))
    return diagnose(result, recording(*effects, points=True, colour=colour) if held_out else None)


def named(found):
    return [(item.effect, item.joint or item.channel) for item in found.findings]


@pytest.mark.parametrize("colour", [0.0, 0.7])
def test_nothing_concealed_is_nothing_found(colour):
    found = diagnosis(colour=colour)
    assert (found.verdict, found.findings, found.unexplained) == ("consistent", (), None)
    assert len(found.blind_spots) == 43
    for spot in found.blind_spots:
        assert (spot.smallest_detectable is None) == bool(spot.reason)


def test_stribeck_friction_is_named_measured_and_shown_on_other_data():
    truth = {"excess_nm": 6.0, "speed_rad_s": 0.08, "exponent": 2.0}
    found = diagnosis(EffectSpec("stribeck_friction", "joint_2", None, truth), held_out=True)
    assert (found.verdict, named(found)) == ("explained", [("stribeck_friction", "joint_2")])
    values = {p.name: p for p in found.findings[0].parameters}
    assert abs(values["fs_minus_fc"].value - 6.0) < 4.0 * values["fs_minus_fc"].std
    assert abs(values["vs"].value - 0.08) < 4.0 * values["vs"].std
    assert found.findings[0].where.channels == ("joint_2",)
    gain = found.held_out.channels["joint_2"]
    assert gain.after < gain.before
    assert gain.low > 0.0
    assert gain.after**2 - gain.noise**2 < 0.5 * (gain.before**2 - gain.noise**2)
    training = found.training
    assert training.after["joint_2"] < 1.05 * training.noise["joint_2"] < training.before["joint_2"]


def test_two_effects_are_told_apart():
    effects = (
        EffectSpec("plate_crosstalk", None, "force.x->torque.z", {"factor": 0.05}),
        EffectSpec("load_dependent_friction", "joint_2", None, {"coefficient": 0.05}),
    )
    found = diagnosis(*_with_known_parameters(effects))
    assert ("load_dependent_friction", "joint_2") in named(found)
    assert ("plate_crosstalk", "force.x->torque.z") in named(found)
    assert found.verdict == "explained"


def _with_known_parameters(effects):
    """The same effects under the plant's own parameter names, at these sizes."""
    from drivers.virtual.effects.registry import effect_class

    result = []
    for item in effects:
        kind, plant = effect_class(item.name), load_plant("ir361")
        index = plant.joint_names.index(item.joint) if item.joint else 0
        parameters = {key: span.draw(np.random.default_rng(0)) for key, span in kind.ranges(plant, index).items()}
        parameters[kind.size] = next(iter(item.parameters.values()))
        result.append(EffectSpec(item.name, item.joint, item.channel, parameters))
    return result


def test_what_the_catalogue_does_not_hold_gets_no_name():
    spike = EffectSpec("torque_spike", "joint_2", None, {})
    found = diagnosis(*_spiked(spike))
    assert (found.verdict, found.findings) == ("unexplained", ())
    assert found.unexplained.channels[0] == "joint_2"
    assert found.next_experiment["kind"] == "companions"


def _spiked(item):
    from drivers.virtual.effects.registry import effect_class

    plant = load_plant("ir361")
    parameters = {k: span.draw(np.random.default_rng(1)) for k, span in effect_class(item.name).ranges(plant, 1).items()}
    parameters[effect_class(item.name).size] *= 3.0
    return (EffectSpec(item.name, item.joint, None, parameters),)


def test_what_changes_over_the_run_is_named_as_such():
    drift = _with_known_parameters((EffectSpec("current_offset_drift", "joint_3", None, {"size": 0.02}),))
    found = diagnosis(*drift)
    assert named(found) == [("current_offset_drift", "joint_3")]
    assert found.findings[0].where.region == "changing from period to period"


def test_a_wrong_torque_constant_in_the_robot_file_is_a_finding():
    error = _with_known_parameters((EffectSpec("torque_constant_error", "joint_1", None, {"size": 0.08}),))
    found = diagnosis(*error)
    assert ("torque_constant_error", "joint_1") in named(found)
    item = next(f for f in found.findings if f.effect == "torque_constant_error")
    value = next(p for p in item.parameters if p.name == "e")
    assert abs(abs(value.value) - 0.08) < 0.02


def test_without_a_plate_fewer_claims_are_made():
    found = diagnosis(kind="internal")
    assert found.verdict == "consistent"
    plate = next(spot for spot in found.blind_spots if spot.effect == "plate_gain_error")
    assert plate.smallest_detectable is None
    assert "no place for it" in plate.reason
