"""The set points of a run: smooth, within limits, periodic to the last bit."""

import itertools
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daq.errors import UsageError
from daq.excitation import Excitation, excitation_of, read_excitation
from daq.limits import Watch, limits_of
from daq.moves import move_between
from daq.run_report import spans
from daq.run_state import FINAL, TABLE, RunEvent, RunState, RunStatus
from daq.trajectory import plan_excitation, plan_validation

PERIOD_S = 6.667e-3
NAMES = ("a", "b")


def orbit(fundamental_hz=0.5, size=0.2):
    cosine = size * np.array([[1.0, 0.3], [-0.5, 0.2]])
    sine = size * np.array([[0.2, -0.4], [0.6, 0.1]])
    return Excitation(NAMES, fundamental_hz, np.array([0.1, -0.1]), cosine, sine)


def bounds(acceleration=np.inf, **changes):
    given_limits = {"lower": [-1.0, -1.0], "upper": [1.0, 1.0], "velocity": [3.0, 3.0]}
    return limits_of(NAMES, **{**given_limits, **changes}, acceleration=[acceleration] * 2)


def plan(start=(0.0, 0.0), periods=2, acceleration=np.inf):
    return plan_excitation(orbit(), bounds(acceleration), np.array(start), PERIOD_S, periods, 1)


def test_every_period_is_the_same_to_the_last_bit():
    made = plan()
    shown = made.q[made.first : made.stop].reshape(3, made.cycles_per_period, 2)
    np.testing.assert_array_equal(shown[0], shown[1])
    np.testing.assert_array_equal(shown[0], shown[2])
    assert made.fundamental_hz * made.cycles_per_period * PERIOD_S == pytest.approx(1.0, rel=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8))
def test_the_whole_motion_is_twice_continuously_differentiable(a, b):
    """Table, speed and acceleration agree by finite differences, across all seams."""
    made = plan((a, b))
    speed = np.gradient(made.q, PERIOD_S, axis=0)[1:-1]
    bend = np.diff(made.q, 2, axis=0) / PERIOD_S**2
    assert np.abs(speed - made.qd[1:-1]).max() < 0.02 * np.abs(made.qd).max() + 0.01
    assert np.abs(bend - made.qdd[1:-1]).max() < 0.05 * np.abs(made.qdd).max() + 0.05
    np.testing.assert_allclose(made.q[0], (a, b), atol=1e-12)
    np.testing.assert_allclose(made.q[-1], (a, b), atol=1e-12)
    assert np.abs(made.qd[[0, -1]]).max() < 1e-12


def test_ramps_keep_the_acceleration_limit():
    tight = plan(acceleration=8.0)
    orbital = np.abs(orbit().evaluate(np.arange(0, 2, PERIOD_S))[2]).max()
    assert np.abs(tight.qdd).max() <= max(8.0, orbital * 1.001)


def test_whole_periods_count_only_measured_ones():
    made = plan(periods=3)
    lead = made.first + made.cycles_per_period
    assert made.whole_periods(lead) == 0
    assert made.whole_periods(lead + made.cycles_per_period - 1) == 0
    assert made.whole_periods(lead + 2 * made.cycles_per_period) == 2
    assert made.whole_periods(made.cycles) == 3


def test_a_validation_motion_rests_at_points_inside_its_box():
    low, high = np.array([-0.5, 0.1]), np.array([0.5, 0.4])
    made = plan_validation(bounds(), np.zeros(2), PERIOD_S, low, high, points=5, seed=3)
    other = plan_validation(bounds(), np.zeros(2), PERIOD_S, low, high, points=5, seed=4)
    assert made.q.min() >= -0.5
    assert np.abs(made.qd).max() <= 3.0
    assert made.kind == "validation"
    assert not np.array_equal(made.q[:200], other.q[:200])


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.1, 5), st.floats(0.1, 50))
def test_moves_keep_their_share_of_the_limits(start, goal, speed, rise):
    move = move_between(np.array([start]), np.array([goal]), np.array([speed]), np.array([rise]), 0.5)
    _, qd, qdd = move.evaluate(np.linspace(0, move.duration_s, 501))
    assert np.abs(qd).max() <= 0.5 * speed * 1.001
    assert np.abs(qdd).max() <= 0.5 * rise * 1.001


CONTENT = {
    "joints": ["a", "b"], "fundamental_hz": 0.1, "offset": [0.0, 0.0], "cosine": [[1.0], [1.0]],
    "sine": [[0.0], [0.0]],
}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"offset": [0.0]}, "shapes"),
        ({"sine": [[0.0, 1.0], [0.0, 1.0]]}, "shapes"),
        ({"fundamental_hz": 0.0}, "not positive"),
        ({"offset": [0.0, float("nan")]}, "not finite"),
        ({"cosine": "x"}, "no number"),
        ({"hash": "0" * 64}, "hash"),
    ],
)
def test_a_bad_excitation_is_refused_in_a_sentence(change, words):
    with pytest.raises(UsageError, match=words):
        excitation_of({**CONTENT, **change}, "e.json")


def test_an_excitation_is_read_and_reordered(tmp_path):
    path = tmp_path / "e.json"
    path.write_text(json.dumps({**CONTENT, "cosine": [[1.0], [2.0]]}))
    turned = read_excitation(path).ordered(("b", "a"))
    assert turned.cosine.tolist() == [[2.0], [1.0]]
    with pytest.raises(UsageError, match="moves b, a but the robot has a, c"):
        turned.ordered(("a", "c"))
    for lacking in ("joints", "offset"):
        with pytest.raises(UsageError, match=lacking):
            excitation_of({key: value for key, value in CONTENT.items() if key != lacking}, "e.json")


def test_the_watch_sees_position_distance_and_speed():
    step_ns = 6_667_000

    def judged(positions, targets):
        watch = Watch(bounds())
        for k, (q, goal) in enumerate(zip(positions, targets, strict=True)):
            watch.commanded(goal)
            reason = watch.measured(q, k * step_ns)
            if reason:
                return reason
        return None

    calm = [[0.01 * k, 0.0] for k in range(40)]
    assert judged(calm, calm) is None
    assert judged([[None, 0.0]] * 3, [[0.0, 0.0]] * 3) is None
    assert "outside its limits" in judged([[1.05, 0.0]], [[1.0, 0.0]])
    assert "away from its set points" in judged([[0.0, 0.2]], [[0.0, 0.0]])
    fast = [[-0.9 + 0.03 * k, 0.0] for k in range(40)]
    assert "speed 4.5" in judged(fast, fast)


def test_spans():
    assert spans([]) == ""
    assert spans([3, 9, 7, 8, 3]) == "3, 7-9"


@given(st.lists(st.sampled_from(list(RunEvent)), max_size=12))
def test_no_sequence_of_events_leaves_the_table(events):
    heard = []
    status = RunStatus(heard.append)
    for event in events:
        if (status.state, event) in TABLE:
            status.advance(event)
        else:
            with pytest.raises(UsageError):
                status.advance(event)
    assert [change.number for change in heard] == list(range(1, len(heard) + 1))
    assert status.is_final == (status.state in FINAL)


def test_final_states_are_final_and_every_other_reaches_one():
    assert not any(state in FINAL for state, _ in TABLE)
    reached = {state: set() for state in RunState}
    for (before, _), after in TABLE.items():
        reached[before].add(after)
    for state in set(RunState) - FINAL:
        seen = {state}
        for _ in RunState:
            seen |= set(itertools.chain.from_iterable(reached[s] for s in seen))
        assert RunState.INTERRUPTED in seen
        assert seen & {RunState.RECORDED, RunState.ABORTED}
