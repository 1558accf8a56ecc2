"""Do stated uncertainties hold? 200 repeats on the virtual robot against the Cramer-Rao bound and coverage.

Run: ``.venv/bin/python -m benchmarks.bench_statistics [REPEATS]``. One noise-free run of the virtual robot
(16 periods, three axes, plate on its own clock, lost samples) gets fresh sensor noise every time; the whole
chain is then fitted.
"""

import sys

import numpy as np
from scipy import stats

from benchmarks import virtual_runs as runs
from identify.fit import FitOptions, fit
from identify.model import build_model
from identify.noise import NoiseModel
from identify.solve import solve

CASES = (("white", 0.0, 0.0), ("AR(1) 0.6, correlated 0.3", 0.6, 0.3))


def truth(model):
    """A fit of the noise-free run: what every estimate aims at."""
    found = fit(runs.robot().robot, runs.dataset(runs.noise_free()), FitOptions(), model)
    return np.concatenate([found.theta, [k.value for k in found.torque_constants]]), found


def bound(clean, ar1, correlation):
    """Cramer-Rao bound of (parameters, torque constants) under the true noise."""
    joints = runs.robot().robot.joints
    size = np.array([*runs.PAPER_JOINTS, *runs.PAPER_WRENCH]) * np.sqrt(1 - ar1**2)
    mix = np.eye(9)
    mix[:3, :3] += correlation * (1 - np.eye(3))
    mix[3:, 3:] += correlation * (1 - np.eye(6))
    filters = tuple(np.array([1.0, -ar1]) if ar1 else np.ones(1) for _ in size)
    noise = NoiseModel(filters, mix * np.outer(size, size), size, 1e12, True)
    solution = solve(
        clean.rows.blocks, [noise], 3, np.arange(3), (clean.solution.theta, clean.solution.scale)
    )
    std = np.sqrt(np.diag(solution.covariance))
    nominal = np.array([joint.drive.torque_constant for joint in joints])
    return np.concatenate([std[:-3], std[-3:] * nominal / solution.scale**2])


def repeats(model, count, ar1, correlation):
    values, stated, p = [], [], []
    for seed in range(count):
        data = runs.dataset(runs.with_noise(runs.noise_free(), seed, ar1, correlation))
        found = fit(runs.robot().robot, data, FitOptions(), model)
        values.append(np.concatenate([found.theta, [k.value for k in found.torque_constants]]))
        stated.append(np.sqrt(np.diag(found.covariance)))
        p.append(found.lack_of_fit.p)
    return np.array(values), np.array(stated), np.array(p)


def main(count=None):
    count = count or (int(sys.argv[1]) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 200)
    model = build_model(runs.robot().robot, "combined")
    true, clean = truth(model)
    print(f"{count} repeats, 16 periods, 40 parameters and 3 torque constants; simulated")
    for name, ar1, correlation in CASES:
        values, stated, p = repeats(model, count, ar1, correlation)
        expected, error = bound(clean, ar1, correlation), values - true
        scatter = np.sqrt(np.mean(error**2, axis=0))
        coverage = np.mean(np.abs(error / stated) < stats.norm.ppf(0.975))
        ratio, spread = stated.mean(axis=0) / expected, scatter / expected
        uniform, bias = stats.kstest(p, "uniform").pvalue, np.abs(error.mean(axis=0) / scatter).max()
        print(f"{name}:")
        print(f"  stated std / Cramer-Rao bound {ratio.min():.3f} to {ratio.max():.3f}")
        print(f"  scatter / bound: mean {spread.mean():.3f}, {spread.min():.3f} to {spread.max():.3f}")
        print(f"    (chance alone: +- {1 / np.sqrt(2 * count):.3f} each)")
        print(f"  95 % intervals cover {100 * coverage:.1f} %")
        print(f"  largest bias {bias * np.sqrt(count):.1f} std of the mean")
        print(f"  lack of fit: p uniform, KS p = {uniform:.2f}; below 0.01: {100 * np.mean(p < 0.01):.1f} %")


if __name__ == "__main__":
    main()
