import numpy as np
import pytest

from drivers.virtual.plant_file import load_plant
from drivers.virtual.trajectories import random_fourier


@pytest.fixture(scope="session")
def arm():
    return load_plant("ir361")


@pytest.fixture(scope="session")
def quiet_arm(arm):
    return arm.quiet()


@pytest.fixture(scope="session")
def motion(arm):
    return random_fourier(arm, seed=7)


@pytest.fixture(scope="session")
def states():
    random = np.random.default_rng(11)

    def draw(plant, count=40):
        return tuple(random.uniform(-1.0, 1.0, (count, len(plant.joints))) * s for s in (0.9, 1.2, 4.0))

    return draw
