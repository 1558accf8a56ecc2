import numpy as np
import pytest

from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.errors import PlantError
from drivers.virtual.plant_file import load_plant
from drivers.virtual.robot import VirtualRobot

PERIOD_S = 1.0 / 150.0


def drive(robot, motion, count):
    rows = []
    for k in range(count):
        robot.command_position(motion.position(np.array([k * PERIOD_S]))[0])
        robot.advance_to(k * PERIOD_S)
        rows.append(
            np.concatenate([robot.sample_encoders(), robot.sample_currents(), robot.sample_wrench()])
        )
    return np.array(rows)


def test_the_robot_follows_its_commands(quiet_arm, motion):
    robot = VirtualRobot(quiet_arm, command_period_s=PERIOD_S, start_q=motion.position(np.zeros(1))[0])
    seen = drive(robot, motion, 300)[:, :3]
    wanted = motion.position(np.arange(300) * PERIOD_S)
    lag = 2  # the drives interpolate towards the last target
    assert np.abs(seen[60:] - wanted[60 - lag : -lag]).max() < 0.01


def test_a_robot_without_commands_stands_still_and_holds_its_load(quiet_arm):
    robot = VirtualRobot(quiet_arm, start_q=np.array([0.2, 0.3, -0.1]))
    robot.advance_to(2.0)
    first = robot.sample_currents()
    robot.step(1.0)
    assert np.allclose(robot.sample_encoders(), [0.2, 0.3, -0.1], atol=1e-9)
    assert np.allclose(robot.sample_currents(), first, atol=1e-6)
    weight = 9.81 * sum(link.mass_kg for link in quiet_arm.links)
    assert robot.read_wrench()[2] == pytest.approx(weight + quiet_arm.plate.offsets[2], abs=1e-6)


def test_a_command_that_stops_coming_stops_the_robot(quiet_arm, motion):
    robot = VirtualRobot(quiet_arm, command_period_s=PERIOD_S, start_q=motion.position(np.zeros(1))[0])
    drive(robot, motion, 100)
    robot.advance_to(3.0)
    one = robot.sample_encoders()
    robot.advance_to(4.0)
    assert np.abs(robot.sample_encoders() - one).max() < 1e-7
    assert np.abs(robot.target - one).max() < 1e-3


def test_the_same_seed_gives_the_same_samples(arm, motion):
    runs = [drive(VirtualRobot(arm, seed=s, command_period_s=PERIOD_S), motion, 40) for s in (1, 1, 2)]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_the_past_can_be_sampled_but_not_the_future(arm):
    robot = VirtualRobot(arm)
    robot.advance_to(1.0)
    assert robot.sample_wrench(0.9995).shape == (6,)
    with pytest.raises(PlantError, match="advance it first"):
        robot.sample_wrench(2.0)
    with pytest.raises(PlantError, match="run back"):
        robot.advance_to(0.5)


def test_a_long_session_forgets_its_past(arm):
    robot = VirtualRobot(arm, effects=[EffectSpec("presliding_friction", "joint_1")], keep_s=1.0)
    for k in range(1, 40):
        robot.command_joint(0, 0.1 * np.sin(k))
        robot.advance_to(0.5 * k)
        assert np.isfinite(robot.sample_currents()).all()
    assert len(robot.plant._servo.history.series("q")) < 1500
    with pytest.raises(PlantError):
        robot.sample_encoders(1.0)


@pytest.mark.parametrize("wrong", [[0.0, 0.0], [0.0, 0.0, float("nan")], [[0.0, 0.0, 0.0]]])
def test_an_impossible_command_is_refused(arm, wrong):
    with pytest.raises(PlantError):
        VirtualRobot(arm).command_position(wrong)


def test_every_effect_of_a_joint_runs_step_by_step_too():
    plant = load_plant("ir361")
    effects = [
        EffectSpec(name, "joint_2")
        for name in ("joint_elasticity", "backlash", "presliding_friction", "gas_balancer", "current_delay")
    ]
    robot = VirtualRobot(
        plant, [*effects, EffectSpec("platform_compliance"), EffectSpec("plate_high_pass")]
    )
    for k in range(50):
        robot.command_joint(1, 0.1 * np.sin(0.3 * k))
        robot.advance_to(k * PERIOD_S)
        samples = np.concatenate([robot.sample_currents(), robot.sample_wrench()])
        assert np.isfinite(samples).all()
