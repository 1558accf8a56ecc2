import numpy as np
import pytest

from drivers.virtual.effects.draw import draw_effect
from drivers.virtual.effects.effect import CHANNELS, EffectSpec
from drivers.virtual.effects.registry import (
    catalogued,
    default_sizes,
    effect_class,
    effect_classes,
    make_effects,
    uncatalogued,
)
from drivers.virtual.errors import PlantError
from drivers.virtual.plant_file import load_plant
from drivers.virtual.record import run_motion
from drivers.virtual.trajectories import random_fourier

T_S = np.arange(0.0, 10.0, 1.0 / 150.0)

# the catalogue to 5, spelled as there
CATALOGUE = {
    "stribeck_friction",
    "asymmetric_viscous_friction",
    "nonlinear_viscous_friction",
    "load_dependent_friction",
    "bearing_moment_friction",
    "position_dependent_friction",
    "thermal_friction",
    "presliding_friction",
    "coupled_transmission_friction",
    "cogging",
    "torque_ripple",
    "transmission_error",
    "backlash",
    "joint_elasticity",
    "rotor_inertia",
    "torque_constant_error",
    "torque_constant_saturation",
    "torque_constant_drift",
    "current_offset_drift",
    "current_dead_zone",
    "current_delay",
    "gravity_compensation_spring",
    "gas_balancer",
    "cable_stiffness",
    "external_hose",
    "external_contact",
    "air_drag",
    "payload",
    "joint_zero_offset",
    "link_geometry_error",
    "base_tilt",
    "link_vibration",
    "plate_gain_error",
    "plate_crosstalk",
    "plate_origin_offset",
    "plate_yaw_misalignment",
    "plate_high_pass",
    "plate_drift",
    "platform_compliance",
    "plate_time_skew",
    "encoder_time_skew",
    "clock_drift",
    "encoder_eccentricity",
}

# which of encoders, currents, wrench change
STREAMS = {"I": {"currents"}, "B": {"currents", "wrench"}, "P": {"wrench"}}
SENSING = {
    "plate_time_skew": {"wrench"},
    "clock_drift": {"wrench"},
    "encoder_time_skew": {"encoders"},
    "encoder_eccentricity": {"encoders"},
}


def spec_of(name, joint="joint_2", **parameters):
    place = effect_class(name).place
    channel = {"crosstalk": "force.x->torque.y", "channel": "force.y"}.get(place)
    return EffectSpec(name, joint if place == "joint" else None, channel, parameters)


def streams(plant, motion, *effects):
    run = run_motion(plant, motion, 10.1, effects)
    return {name: getattr(run, name)(T_S) for name in ("encoders", "currents", "wrench")}


@pytest.fixture(scope="module")
def base(quiet_arm, motion):
    return streams(quiet_arm, motion)


def changed(one, other):
    return {name for name in one if np.abs(one[name] - other[name]).max() > 1e-9}


def test_the_whole_catalogue_is_there():
    assert set(catalogued()) == CATALOGUE
    assert len(uncatalogued()) == 3


@pytest.mark.parametrize("name", sorted(effect_classes()))
def test_an_effect_changes_the_streams_it_should(name, quiet_arm, motion, base):
    seen = streams(quiet_arm, motion, spec_of(name))
    wanted = SENSING.get(name) or STREAMS[effect_class(name).where]
    assert changed(seen, base) == wanted


@pytest.mark.parametrize("name", sorted(effect_classes()))
def test_an_effect_of_size_zero_is_none(name, quiet_arm, motion, base):
    nothing = streams(quiet_arm, motion, spec_of(name, **{effect_class(name).size: 0.0}))
    for stream, values in base.items():
        assert np.abs(nothing[stream] - values).max() < 1e-9, stream


@pytest.mark.parametrize("name", [n for n in sorted(effect_classes()) if effect_class(n).where == "I"])
def test_an_effect_inside_a_joint_stays_in_that_joint(name, quiet_arm, motion, base):
    seen = streams(quiet_arm, motion, spec_of(name, "joint_3"))
    others = [0] if name == "coupled_transmission_friction" else [0, 1]
    assert np.abs(seen["currents"][:, others] - base["currents"][:, others]).max() < 1e-12
    assert np.abs(seen["currents"][:, 2] - base["currents"][:, 2]).max() > 1e-6


@pytest.mark.parametrize("name", sorted(effect_classes()))
def test_default_sizes_are_drawn_inside_their_range(name, arm):
    random = np.random.default_rng(3)
    for parameter, span in default_sizes(arm, name).items():
        draws = np.array([span.draw(random) for _ in range(20)])
        size = np.abs(draws) if span.signed else draws
        assert span.unit, parameter
        assert np.all((size >= span.low - 1e-12) & (size <= span.high + 1e-12)), parameter


@pytest.mark.parametrize("name", sorted(effect_classes()))
def test_effects_live_on_a_six_axis_arm_too(name):
    plant = load_plant("six_axis").quiet()
    spec = spec_of(name, "joint_5")
    run = run_motion(plant, random_fourier(plant, 2), 0.5, [spec])
    t_s = np.linspace(0.0, 0.5, 20)
    for stream in ("encoders", "currents", "wrench"):
        assert np.isfinite(getattr(run, stream)(t_s)).all()


def test_wrong_names_places_and_parameters_are_refused(arm):
    for wrong in (
        EffectSpec("stribeck"),
        EffectSpec("stribeck_friction"),
        EffectSpec("stribeck_friction", "joint_9"),
        EffectSpec("plate_crosstalk", channel="force.x"),
        EffectSpec("plate_drift", channel="force.w"),
        EffectSpec("cogging", "joint_1", parameters={"hight": 1.0}),
    ):
        with pytest.raises(PlantError):
            make_effects([wrong], arm)


def extra_torque(plant, motion, name, joint=1, **parameters):
    spec = spec_of(name, f"joint_{joint + 1}", **parameters)
    run = run_motion(plant, motion, 10.1, [spec])
    plain = run_motion(plant, motion, 10.1)
    moments = run.moments(T_S)
    return moments, (run.torques(moments) - plain.torques(plain.moments(T_S)))[:, joint]


@pytest.mark.parametrize(
    "name",
    [
        "stribeck_friction",
        "nonlinear_viscous_friction",
        "load_dependent_friction",
        "bearing_moment_friction",
    ],
)
def test_static_friction_only_takes_power(name, quiet_arm, motion):
    moments, torque = extra_torque(quiet_arm, motion, name)
    assert np.all(torque * moments.qd[:, 1] >= -1e-9)


def test_presliding_is_passive_and_ends_as_coulomb_friction(quiet_arm, motion):
    run = run_motion(quiet_arm, motion, 10.1, [spec_of("presliding_friction", slide_rad=1e-3)])
    t_s = np.linspace(0.0, 10.0, 20001)
    m = run.moments(t_s)
    fc = quiet_arm.joints[1].coulomb_nm
    friction = run.torques(m)[:, 1] - run.loads(m).joint_nm[:, 1]
    plain = run_motion(quiet_arm, motion, 10.1)
    rest = (plain.torques(plain.moments(t_s)) - plain.loads(plain.moments(t_s)).joint_nm)[:, 1]
    friction = friction - rest + fc * np.sign(m.qd[:, 1])
    assert np.all(np.abs(friction) <= fc + 1e-6)
    assert np.trapezoid(friction * m.qd[:, 1], t_s) > 0.0
    fast = np.abs(m.qd[:, 1]) > 0.15
    assert np.abs(friction - fc * np.sign(m.qd[:, 1]))[fast].max() < 0.02 * fc
    assert np.abs(np.diff(friction)).max() < 0.2 * fc  # no jump at the reversal


def test_presliding_does_not_depend_on_the_step(quiet_arm, motion):
    fine = quiet_arm.model_copy(update={"servo": quiet_arm.servo.model_copy(update={"tick_s": 5e-4})})
    spec = spec_of("presliding_friction", slide_rad=1e-3)
    coarse_current = run_motion(quiet_arm, motion, 5.0, [spec]).currents(T_S[:700])
    fine_current = run_motion(fine, motion, 5.0, [spec]).currents(T_S[:700])
    noise_a = 4.03 / (103.235 * 0.215)
    # a turn inside a tick loses its last micrometres of slide
    assert np.abs(coarse_current - fine_current).max() < 0.03 * noise_a


def test_a_delayed_current_is_the_earlier_current(quiet_arm, motion, base):
    run = run_motion(quiet_arm, motion, 10.1, [spec_of("current_delay", delay_s=2e-3)])
    plain = run_motion(quiet_arm, motion, 10.1)
    assert np.allclose(run.currents(T_S)[:, 1], plain.currents(T_S - 2e-3)[:, 1])
    assert np.allclose(run.currents(T_S)[:, 0], base["currents"][:, 0])


def test_the_high_pass_forgets_a_step_with_its_time_constant(quiet_arm):
    effect = make_effects([EffectSpec("plate_high_pass", parameters={"corner_rad_s": 0.1})], quiet_arm)[0]
    effect.begin(2e-3, None, None)
    t_s = np.arange(0.0, 30.0, 1.0 / 150.0)
    wrench = np.zeros((len(t_s), 6))
    wrench[1:, 2] = 10.0
    seen = effect.plate(t_s, wrench)
    assert np.allclose(seen[1:, 2], 10.0 * np.exp(-0.1 * (t_s[1:] - t_s[1])), rtol=2e-3)
    assert np.all(seen[:, 0] == 0.0)


def test_the_high_pass_continues_from_call_to_call(quiet_arm, motion):
    spec = spec_of("plate_high_pass")
    whole = run_motion(quiet_arm, motion, 10.1, [spec]).wrench(T_S)
    run = run_motion(quiet_arm, motion, 10.1, [spec])
    pieces = np.vstack([run.wrench(piece) for piece in np.array_split(T_S, 40)])
    assert np.allclose(whole, pieces, atol=1e-6)


def test_elasticity_settles_at_load_over_stiffness(quiet_arm):
    from drivers.virtual.plant import VirtualPlant

    spec = spec_of("joint_elasticity", compliance_rad_nm=2e-5)
    plant = VirtualPlant(quiet_arm, [spec], start_q=np.array([0.0, 0.4, 0.0]))
    plant.follow(np.tile([0.0, 0.4, 0.0], (600, 1)))
    moments = plant.moments(np.array([2.3]))
    link = plant.link_motion(moments)[0]
    load = plant.rigid.inverse(moments.q, moments.qd, moments.qdd).link_nm[0, 1]
    assert (link - moments.q)[0, 1] == pytest.approx(-2e-5 * load, rel=1e-3)


def test_backlash_lies_on_one_flank_or_the_other(quiet_arm, motion):
    run = run_motion(quiet_arm, motion, 10.1, [spec_of("backlash", gap_rad=4e-4)])
    moments = run.moments(T_S)
    play = (run.link_motion(moments)[0] - moments.q)[:, 1]
    load = run.loads(moments).link_nm[:, 1]
    assert np.abs(play).max() <= 2.05e-4
    settled = np.abs(load) > 60.0
    assert np.mean(np.abs(play + 2e-4 * np.sign(load))[settled] < 2e-5) > 0.9


def test_an_outside_force_is_one_force_in_both_models(quiet_arm, motion, base):
    """The plate's extra force is minus the hose's pull; the joints feel it through the arm."""
    pull = streams(quiet_arm, motion, spec_of("external_hose", stiffness_n_m=50.0))
    extra = base["wrench"] - pull["wrench"]
    assert np.abs(extra[:, :3]).max() > 1.0
    run = run_motion(quiet_arm, motion, 10.1)
    m = run.moments(T_S[:200])
    link = quiet_arm.links[-1]
    point = 1.5 * np.array(link.com_m)
    tip = np.array([run.rigid.point(q, "link_3", point) for q in m.q])
    cross = np.cross(tip, extra[:200, :3])
    assert np.allclose(cross, extra[:200, 3:], atol=1e-6)
    # joint 1 turns about the base's z axis: its share of the moment is the moment about z
    gear = quiet_arm.joints[0].gear_ratio * quiet_arm.joints[0].torque_constant_nm_a
    joint = (base["currents"] - pull["currents"])[:200, 0] * gear
    assert np.allclose(joint, extra[:200, 5], atol=1e-6)


def test_payload_adds_its_weight(quiet_arm, motion, base):
    heavy = streams(quiet_arm, motion, spec_of("payload", mass_kg=2.0))
    assert np.mean(heavy["wrench"][:, 2] - base["wrench"][:, 2]) == pytest.approx(2.0 * 9.81, abs=0.5)


def test_gas_has_a_loop_when_warm_and_none_without_time_to_exchange(quiet_arm, motion):
    def loop(heat_time_s):
        m, torque = extra_torque(quiet_arm, motion, "gas_balancer", heat_time_s=heat_time_s)
        return abs(np.trapezoid(torque * m.qd[:, 1], T_S)) / np.trapezoid(np.abs(torque * m.qd[:, 1]), T_S)

    assert loop(1.0) > 3.0 * loop(1e4)


def test_crosstalk_and_gain_touch_only_their_channels(quiet_arm, motion, base):
    mixed = streams(quiet_arm, motion, spec_of("plate_crosstalk", coefficient=0.02))["wrench"]
    sink = CHANNELS.index("torque.y")
    assert np.allclose(mixed[:, sink] - base["wrench"][:, sink], 0.02 * base["wrench"][:, 0])
    assert np.allclose(np.delete(mixed, sink, 1), np.delete(base["wrench"], sink, 1))
    larger = streams(quiet_arm, motion, EffectSpec("plate_gain_error", parameters={"share": 0.01}))[
        "wrench"
    ]
    assert np.allclose(larger, 1.01 * base["wrench"])


def test_saturation_inverts_its_own_law(quiet_arm, motion, base):
    spec = spec_of("torque_constant_saturation", coefficient_1_a2=1e-3)
    amps = streams(quiet_arm, motion, spec)["currents"][:, 1]
    assert np.allclose(amps * (1.0 - 1e-3 * amps**2), base["currents"][:, 1], atol=1e-9)


@pytest.mark.parametrize("name", sorted(effect_classes()))
def test_drawn_effects_can_be_built(name, arm):
    random = np.random.default_rng(1)
    for _ in range(3):
        drawn = draw_effect(arm, name, random)
        effect = make_effects([drawn], arm)[0]
        assert effect.p == dict(drawn.parameters)
        assert (drawn.joint is not None) == (effect.place == "joint")
