"""Regressors of joint torques and base wrench against a loop over Pinocchio, in one run.

Run: ``python -m benchmarks.bench_regressor``. Pinocchio (``pip install pin``) is no dependency; without it
only our own times are printed. Times are of the processor, one thread.
"""

import time

import numpy as np

from benchmarks.bench_figaroh import SAMPLES, make_robot
from benchmarks.virtual_runs import robot as reference
from identify.regressor import rigid_columns


def best(function, repeats=5):
    times = []
    for _ in range(repeats):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


def ours(robot, states, external):
    chunk = 2048  # as the product does: the working set stays in the cache
    for first in range(0, SAMPLES, chunk):
        rigid_columns(robot, *(x[:, first : first + chunk] for x in states), external=external)


def pinocchio_loop(urdf, states, external):
    """Seconds of the plain loop; the base wrench needs a free root joint. None without Pinocchio."""
    try:
        import pinocchio as pin
    except ImportError:
        return None
    model = (
        pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer()) if external else pin.buildModelFromXML(urdf)
    )
    data = model.createData()
    q, qd, qdd = (np.ascontiguousarray(x.T) for x in states)
    if external:
        rest = np.zeros((SAMPLES, 6))
        q = np.hstack([np.tile([0, 0, 0, 0, 0, 0, 1.0], (SAMPLES, 1)), q])
        qd, qdd = np.hstack([rest, qd]), np.hstack([rest, qdd])
    rows = np.empty((SAMPLES, model.nv, 10 * (model.njoints - 1)))

    def loop():
        for k in range(SAMPLES):
            rows[k] = pin.computeJointTorqueRegressor(model, data, q[k], qd[k], qdd[k])

    return best(loop, 3)


def main():
    from benchmarks.figaroh_excitation import with_bodies

    six, six_text = make_robot()
    for robot, text in ((reference().robot, with_bodies(reference().urdf_text)), (six, six_text)):
        rng = np.random.default_rng(0)
        states = [rng.normal(size=(robot.n, SAMPLES)) for _ in range(3)]
        for external in (False, True):
            seconds = best(lambda r=robot, s=states, e=external: ours(r, s, e))
            theirs = pinocchio_loop(text, states, external)
            peer = (
                "Pinocchio is not installed"
                if theirs is None
                else f"Pinocchio loop {theirs:.3f} s, ratio {theirs / seconds:.1f}"
            )
            what = f"{robot.n} joints{' and base wrench' if external else ''}"
            print(f"{what:24} {SAMPLES} samples: ours {seconds:.3f} s; {peer}")


if __name__ == "__main__":
    main()
