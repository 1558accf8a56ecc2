"""The virtual robot: a plant with its own physics (MuJoCo), sharing no code with identification."""
