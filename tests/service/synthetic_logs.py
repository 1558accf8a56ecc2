"""Logs of the reference robot, made by linear algebra, for tests of the command line."""

from dataclasses import replace
from functools import cache

import numpy as np

from daq.log_writer import write_recording
from daq.messages import JOINT_STATE, MOTOR_CURRENTS, WRENCH
from daq.recording import Recording, Stream
from service.cli.main import run
from tests.identify import synthetic
from tests.identify.robots import ir361

START_NS = 1_760_000_000_000_000_000
NAMES = ("joint_1", "joint_2", "joint_3")
NOISE = {"torque": 2.0, "wrench": np.array([8.0, 8.0, 4.0, 9.0, 9.0, 3.0]), "encoder": 1e-5}


@cache
def clean(periods=6, seed=0, motion_seed=2):
    motion = synthetic.fourier_motion(3, seed=motion_seed, fundamental_hz=0.25, size=0.2)
    clock = synthetic.Clock(ppm=40.0, phase_s=3e-3, jitter_s=2e-5, loss=0.001)
    return synthetic.noise_free(
        ir361(),
        periods=periods,
        rate_hz=60.0,
        motion=motion,
        plate_clock=clock,
        scale=(1.0, 1.0, 1.0),
        seed=seed,
    )


def _stream(topic, schema, names, frame, t_s, **data):
    stamp = START_NS + np.rint(t_s * 1e9).astype(np.int64)
    return Stream(
        topic, schema, names, frame, stamp, stamp + 2_000_000, np.arange(len(stamp), dtype=np.uint32), data
    )


def recording(noise_seed=0, metadata=None, **which):
    """A periodic run with fresh noise, as a log holds it."""
    data = synthetic.with_noise(clean(**which), np.random.default_rng(noise_seed), **NOISE)
    facts = {
        "schema_version": "1",
        "run_id": f"synthetic-{noise_seed}",
        "robot": "ir361",
        "kind": "excitation",
        "simulated": "true",
        "fundamental_hz": "0.25",
        "harmonics": "5",
        "sample_rate_hz": "60",
        "periods": str(data.facts.periods),
        "transient_periods": "0",
    }
    wrench = data.wrench.values.T
    return Recording(
        "memory",
        _stream(
            "/joint_states",
            JOINT_STATE,
            NAMES,
            "base_link",
            data.position.t_s,
            position=data.position.values.T,
        ),
        _stream(
            "/motor_currents", MOTOR_CURRENTS, NAMES, "", data.current.t_s, current=data.current.values.T
        ),
        _stream(
            "/force_plate/wrench",
            WRENCH,
            (),
            "force_plate",
            data.wrench.t_s,
            force=wrench[:, :3],
            torque=wrench[:, 3:],
        ),
        None,
        {key: value for key, value in {**facts, **(metadata or {})}.items() if value is not None},
        {},
        "",
        (),
    )


def changed(stream, **fields):
    """A stream with other fields; ``position=...`` and the like change its data."""
    data = {**stream.data, **{key: fields.pop(key) for key in list(fields) if key in stream.data}}
    return replace(stream, data=data, **fields)


def rows(stream, keep):
    """Some samples of a stream."""
    return replace(
        stream,
        stamp_ns=stream.stamp_ns[keep],
        log_time_ns=stream.log_time_ns[keep],
        sequence=stream.sequence[keep],
        data={key: values[keep] for key, values in stream.data.items()},
    )


def shifted(recording, shift_ns):
    """The same run at another time."""

    def move(stream):
        if stream is None:
            return None
        return replace(stream, stamp_ns=stream.stamp_ns + shift_ns, log_time_ns=stream.log_time_ns + shift_ns)

    return replace(
        recording,
        joint_states=move(recording.joint_states),
        motor_currents=move(recording.motor_currents),
        wrench=move(recording.wrench),
    )


def write(recording, path):
    write_recording(recording, path)
    return path


def command(capsys, *arguments):
    """Run a command: exit code, standard output, standard error."""
    capsys.readouterr()
    code = run([str(item) for item in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def refused(capsys, expected_code, *arguments):
    """Run a command that must fail properly; give its one sentence."""
    code, out, err = command(capsys, *arguments)
    assert code == expected_code, (code, err)
    assert out == ""
    assert err.startswith("Error: ")
    assert err.count("\n") == 1, "one sentence on one line"
    assert "Traceback" not in err
    assert "Unexpected" not in err
    return err
