"""What can be wrong with a virtual robot's description."""

from drivers.errors import ConfigError


class PlantError(ConfigError):
    """The plant file, the robot description or an effect cannot be simulated as asked (wrong use)."""
