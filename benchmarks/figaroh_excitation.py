"""Run FIGAROH's excitation optimiser on a URDF and store its trajectory; needs an interpreter that has it.

FIGAROH_PYTHON figaroh_excitation.py robot.urdf out.npz [segments] [seed]
"""

import logging
import re
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

CONFIG = """
schema_version: "2.0"
robot:
  name: peer
tasks:
  identification:
    enabled: true
    mechanics: {{}}
    joints: {{}}
    problem: {{has_friction: true, has_joint_offset: true, has_actuator_inertia: false}}
    signal_processing: {{sampling_frequency: 150, cutoff_frequency: 40}}
  optimal_trajectory:
    enabled: true
    problem: {{soft_lim: {soft_lim}, max_iterations: 60, segment_attempts: 3}}
    trajectory: {{waypoints: 6, frequency: 50, segment_duration: 1.0}}
"""
BODY = (
    '<inertial><origin xyz="0.02 0.01 0.15"/><mass value="8"/>'
    '<inertia ixx="0.2" iyy="0.2" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def with_bodies(text: str) -> str:
    """Give every empty link a body: the loader needs one, the optimised condition number does not see it."""
    return re.sub(r'<link name="([^"]+)"\s*/>', rf'<link name="\1">{BODY}</link>', text)


def main(urdf: str, out: str, segments: int = 2, seed: int = 0) -> None:
    from figaroh.optimal.base_optimal_trajectory import BaseOptimalTrajectory, BaseTrajectoryIPOPTProblem
    from figaroh.tools.load_robot import load_robot

    logging.basicConfig(level=logging.ERROR)
    np.random.seed(seed)

    class Trajectory(BaseOptimalTrajectory):
        def create_ipopt_problem(self, *arguments):
            return BaseTrajectoryIPOPTProblem(self, *arguments)

    with tempfile.TemporaryDirectory() as folder:
        path, config = Path(folder) / "robot.urdf", Path(folder) / "config.yaml"
        path.write_text(with_bodies(Path(urdf).read_text()))
        config.write_text(CONFIG.format(soft_lim=0.01))
        robot = load_robot(str(path), package_dirs=folder)
        joints = [name for name in robot.model.names if name != "universe"]
        begin = time.process_time()
        optimiser = Trajectory(robot, joints, str(config))
        optimiser.identif_config |= {  # its loader leaves these to the robot's own subclass
            "active_joints": joints,
            "act_Jid": [robot.model.getJointId(name) for name in joints],
            "act_idxq": [robot.model.joints[robot.model.getJointId(name)].idx_q for name in joints],
            "act_idxv": [robot.model.joints[robot.model.getJointId(name)].idx_v for name in joints],
        }
        optimiser.initialize()
        optimiser.solve(stack_reps=segments)
        cpu_s = time.process_time() - begin
    r = optimiser.results
    np.savez(
        out,
        t=np.concatenate([np.ravel(t) for t in r["T_F"]]),
        q=np.vstack(r["P_F"]).T,
        qd=np.vstack(r["V_F"]).T,
        qdd=np.vstack(r["A_F"]).T,
        cpu_s=cpu_s,
        converged=[d["converged"] for d in r["iteration_data"]],
    )


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], *(int(word) for word in sys.argv[3:]))
