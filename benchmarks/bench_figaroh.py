"""24 000 samples of six joints: regressor, base parameters, weighted estimate and std, against FIGAROH 1.0.2.

Run: ``FIGAROH_PYTHON=/path/to/python python -m benchmarks.bench_figaroh``, where that interpreter has
figaroh 1.0.2 (its own virtual environment: its pins differ from ours). Times are of the processor, one
thread. FIGAROH's estimate is the unweighted one; its weighted one builds a dense matrix of rows times rows,
154 GiB here.
"""

import os
import subprocess
import tempfile
import time
import tracemalloc
from pathlib import Path

import numpy as np

from benchmarks.figaroh_excitation import with_bodies
from drivers.virtual.plant_file import PRESETS
from identify.blocks import Block
from identify.model import build_model
from identify.noise import NoiseModel
from identify.robot import Drive, Robot
from identify.solve import refine, solve
from identify.urdf import read_urdf

SAMPLES, JOINTS = 24_000, 6


def make_robot():
    from dataclasses import replace

    text = with_bodies((PRESETS / "six_axis.urdf").read_text())
    chain = read_urdf(text)
    joints = tuple(replace(joint, drive=Drive()) for joint in chain.joints)
    return Robot("six_axis", joints, reference_parameters=chain.parameters), text


def make_motions(robot, count):
    rng = np.random.default_rng(0)
    q, qd, qdd = (
        rng.uniform(-1.5, 1.5, (JOINTS, count)),
        rng.normal(size=(JOINTS, count)),
        3 * rng.normal(size=(JOINTS, count)),
    )
    from identify.regressor import rigid_columns

    columns = rigid_columns(robot, q, qd, qdd, external=False).internal
    tau = np.einsum("cpn,p->cn", columns, robot.reference_parameters.ravel())
    tau += 10.0 * np.sign(qd) + 5.0 * qd + 1.0 + rng.normal(size=tau.shape)
    return q, qd, qdd, tau


def ours(robot, q, qd, qdd, tau):
    """Structure, regressor, weights from the residual, weighted estimate, full covariance."""
    model = build_model(robot, "internal")
    rows, count = model.drive_rows(q, qd, qdd), q.shape[1]
    usable = np.ones(tau.shape, dtype=bool)
    block = Block(
        robot.joint_names,
        np.arange(JOINTS),
        rows.columns,
        rows.known,
        tau,
        usable,
        1,
        np.arange(count) / 150.0,
    )
    white, none = tuple(np.ones(1) for _ in range(JOINTS)), np.empty(0, dtype=int)

    def noise(size):
        return [NoiseModel(white, np.diag(size**2), size, float(count), False)]

    theta, _ = refine((block,), noise(np.ones(JOINTS)), JOINTS, none)
    rest = tau - np.einsum("cpn,p->cn", rows.columns, theta)
    return solve((block,), noise(rest.std(axis=1)), JOINTS, none)


def timed(function, *arguments, repeats=3):
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        result = function(*arguments)
        best = min(best, time.process_time() - start)
    return best, result


def figaroh(text, motions):
    """Seconds and base parameters of FIGAROH, or the reason why it was not run."""
    python = Path(os.environ.get("FIGAROH_PYTHON", "/tmp/figaroh-venv/bin/python"))
    if not python.exists():
        return None, f"no interpreter with figaroh 1.0.2 at {python}; set FIGAROH_PYTHON"
    with tempfile.TemporaryDirectory() as folder:
        urdf, data = Path(folder) / "robot.urdf", Path(folder) / "motions.npz"
        urdf.write_text(text)
        np.savez(data, **dict(zip(("q", "qd", "qdd", "tau"), motions, strict=True)))
        worker = Path(__file__).with_name("figaroh_worker.py")
        result = subprocess.run([python, worker, urdf, data], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        return None, "figaroh failed: " + (result.stderr.strip().splitlines() or ["no message"])[-1]
    seconds, base = result.stdout.split()[-2:]
    return float(seconds), int(base)


def memory_per_sample(robot):
    peaks = {}
    for count in (SAMPLES // 4, SAMPLES // 2, SAMPLES):
        motions = make_motions(robot, count)
        tracemalloc.start()
        ours(robot, *motions)
        peaks[count] = tracemalloc.get_traced_memory()[1] / 2**20
        tracemalloc.stop()
    return peaks


def main():
    robot, text = make_robot()
    motions = make_motions(robot, SAMPLES)
    seconds, solution = timed(ours, robot, *motions)
    print(
        f"ours: {seconds:.3f} s for {SAMPLES} samples of {JOINTS} joints, {solution.rank} parameters, "
        "weighted, with std"
    )
    theirs, base = figaroh(text, motions)
    if theirs is None:
        print(f"FIGAROH skipped: {base}")
    else:
        print(
            f"FIGAROH 1.0.2: {theirs:.3f} s, {base} parameters, unweighted, with std; "
            f"ratio {theirs / seconds:.1f}"
        )
    peaks = memory_per_sample(robot)
    print(
        "our peak memory: " + ", ".join(f"{peak:.0f} MiB at {count} samples" for count, peak in peaks.items())
    )


if __name__ == "__main__":
    main()
