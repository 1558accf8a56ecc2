"""FIGAROH's regressor, base parameters, estimate and std on given motions; run by an interpreter that has it.

FIGAROH_PYTHON figaroh_worker.py robot.urdf motions.npz  ->  prints seconds and the number of base parameters
"""

import sys
import time
import warnings

import numpy as np


def main(urdf: str, motions: str) -> None:
    warnings.simplefilter("ignore")
    from figaroh.identification.identification_tools import relative_stdev
    from figaroh.tools.load_robot import load_robot
    from figaroh.tools.qrdecomposition import QRDecomposer
    from figaroh.tools.regressor import build_regressor_basic, eliminate_non_dynaffect

    robot, data = load_robot(urdf), np.load(motions)
    q, v, a, tau = (data[key].T for key in ("q", "qd", "qdd", "tau"))
    options = {"has_friction": True, "has_joint_offset": True, "has_actuator_inertia": False,
               "is_joint_torques": True, "act_idxv": list(range(tau.shape[1]))}  # fmt: skip
    build_regressor_basic(robot, q[:50], v[:50], a[:50], options)
    start = time.process_time()
    regressor = build_regressor_basic(robot, q, v, a, options)
    names = {f"p{k}": 0.0 for k in range(regressor.shape[1])}
    reduced, kept = eliminate_non_dynaffect(regressor, names, 1e-6)
    target = tau.T.ravel()
    found = QRDecomposer().double_decomposition(target, reduced, kept, None)
    base, phi = found[0], found[2] if not isinstance(found[2], list) else found[3]
    relative_stdev(base, np.asarray(phi, dtype=float), target)
    print(time.process_time() - start, base.shape[1])


if __name__ == "__main__":
    main(*sys.argv[1:])
