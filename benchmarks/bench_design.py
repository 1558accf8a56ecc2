"""Excitation design: figures of merit and CPU time against random, hand-drawn and FIGAROH trajectories.

    python -m benchmarks.bench_design [--figaroh trajectory.npz] [--quick]

FIGAROH's trajectory comes from ``figaroh_excitation.py``, run by an interpreter that has figaroh and cyipopt.
All trajectories keep the same limits; one metric for all: rows of rigid body, friction and offset (no gravity
compensation, which FIGAROH does not model), raw SI, each trajectory at its own full length.
"""

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402 - the thread count is read at import

from identify.excitation.design import DesignOptions, design, prepare  # noqa: E402 - the thread count is read at import
from identify.excitation.workspace import Sphere, Workspace, distant_pairs  # noqa: E402 - the thread count is read at import
from identify.model import build_model  # noqa: E402 - the thread count is read at import
from identify.robot import Drive, ForcePlate, Robot  # noqa: E402 - the thread count is read at import
from identify.urdf import read_urdf  # noqa: E402 - the thread count is read at import
from service.designs import worker_processes  # noqa: E402 - the thread count is read at import
from service.robots import load_robot  # noqa: E402 - the thread count is read at import

ROOT = Path(__file__).parent.parent
SIX = ROOT / "drivers" / "virtual" / "presets" / "six_axis.urdf"


def without_compensation(robot):
    joints = tuple(replace(j, drive=replace(j.drive, gravity_harmonics=0)) for j in robot.joints)
    return replace(robot, joints=joints)


class Metric:
    """log10 det(W'W / rows), condition of W and of W with unit columns; torque rows, then with wrench."""

    def __init__(self, robot):
        plain = without_compensation(robot)
        self.internal = build_model(plain, "internal")
        self.combined = build_model(plain, "combined")

    def __call__(self, q, qd, qdd):
        drives = self.internal.drive_rows(q, qd, qdd).columns
        both = [self.combined.drive_rows(q, qd, qdd).columns, self.combined.wrench_rows(q, qd, qdd).columns]
        return np.concatenate([self._figures(drives), self._figures(np.concatenate(both))])

    @staticmethod
    def _figures(columns):
        w = columns.transpose(0, 2, 1).reshape(-1, columns.shape[1])
        values = np.linalg.svd(w, compute_uv=False)
        unit = np.linalg.svd(w / np.maximum(np.linalg.norm(w, axis=0), 1e-300), compute_uv=False)
        with np.errstate(divide="ignore"):
            log_det = 2 * np.log10(values).sum() - w.shape[1] * np.log10(len(w))
            return np.array([log_det, values[0] / values[-1], unit[0] / unit[-1]])


def timed(robot, options):
    """Design in two worker processes; CPU of them and of this one, and wall time."""
    before, wall = os.times(), time.perf_counter()
    with worker_processes(2) as executor:
        result = design(robot, options, executor)
    after = os.times()
    cpu = sum(after[k] - before[k] for k in range(4))
    return result, cpu, time.perf_counter() - wall


def row(name, figures, note=""):
    print(f"  {name:34s}" + "".join(f"{v:11.4g}" for v in figures) + f"   {note}")


def best(table):
    signs = np.array([-1, 1, 1, -1, 1, 1])
    return (np.array(table) * signs).min(axis=0) * signs


def three_axes(figaroh, count):
    loaded = load_robot("ir361")
    options = DesignOptions(noise=loaded.file.noise)
    problem = prepare(loaded.robot, options)
    metric = Metric(loaded.robot)
    print("ir361, 3 axes x 5 harmonics of 0.1 Hz   [torque rows | torque and wrench]")
    print(" " * 36 + "".join(f"{h:>11s}" for h in ("log10det", "cond", "unit cond") * 2))
    results = []
    stripped = without_compensation(loaded.robot)
    for criterion, robot, name in (
        ("d", loaded.robot, "design (d)"),
        ("balanced", stripped, "balanced, combined model"),
        ("balanced", replace(stripped, plate=None), "balanced, internal model"),
    ):
        result, cpu, wall = timed(robot, replace(options, criterion=criterion))
        series = result.series
        note = f"log det {result.expected.log_det_covariance:.2f}, {cpu:.1f} s CPU, {wall:.1f} s"
        row(name, metric(*series.evaluate(series.grid_s(400))), note)
        results.append(result)
    rng = np.random.default_rng(0)
    table, values = [], []
    for _ in range(count):
        series = problem.mapping.series(problem.mapping.random(rng))
        table.append(metric(*series.evaluate(series.grid_s(400))))
        values.append(problem.value_of(series))
    row(f"best of {count} random, each figure", best(table), f"log det {min(values):.2f}")
    plain = results[0].plain_series
    by_hand = f"log det {results[0].plain.log_det_covariance:.2f}"
    row("drawn by hand", metric(*plain.evaluate(plain.grid_s(400))), by_hand)
    if figaroh is not None:
        data = np.load(figaroh)
        limits = results[0].limits
        over = np.abs(data["qd"]).max(axis=1) / limits.velocity
        state = "converged" if data["converged"].all() else "not converged"
        note = f"{data['cpu_s']:.1f} s CPU, {state}, velocity/limit {over.max():.2f}"
        row("FIGAROH 1.0.2", metric(data["q"], data["qd"], data["qdd"]), note)


def six_axes(spheres):
    chain = read_urdf(SIX.read_text())
    joints = tuple(
        replace(j, drive=Drive(100.0, 0.3), limits=replace(j.limits, acceleration=4 * j.limits.velocity))
        for j in chain.joints
    )
    robot = Robot("six_axis", joints, plate=ForcePlate())
    workspace = Workspace()
    if spheres:
        places = [
            (-1, 0.1, 0.18),
            (0, 0.05, 0.16),
            (1, 0.15, 0.1),
            (1, 0.4, 0.1),
            (2, 0.15, 0.1),
            (3, 0.15, 0.08),
        ]
        places += [(4, 0.05, 0.07), (5, 0.1, 0.06)]
        balls = tuple(
            Sphere(link, np.array([0.0, 0.0, z]), radius, f"ball {k}")
            for k, (link, z, radius) in enumerate(places)
        )
        workspace = Workspace(balls, floor_m=0.0, pairs=distant_pairs(balls))
    result, cpu, wall = timed(robot, DesignOptions(workspace=workspace))
    name = f"six axes, {len(workspace.pairs)} sphere pairs and floor" if spheres else "six axes"
    print(
        f"{name}: log det {result.expected.log_det_covariance:.1f} (by hand "
        f"{result.plain.log_det_covariance:.1f}), "
        f"condition {result.expected.condition_number:.4g} ({result.plain.condition_number:.4g}), "
        f"clearance {result.peaks.clearance_m:.3f} m, {cpu:.1f} s CPU, {wall:.1f} s"
    )


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--figaroh", type=Path, help="trajectory of figaroh_excitation.py")
    parser.add_argument("--quick", action="store_true", help="three axes, 100 random motions")
    chosen = parser.parse_args(arguments)
    three_axes(chosen.figaroh, 100 if chosen.quick else 1000)
    if not chosen.quick:
        six_axes(False)
        six_axes(True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
