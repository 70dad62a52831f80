from pathlib import Path

import numpy as np
import pytest

import pkm

FIXTURES = Path(__file__).parents[3] / "fixtures"
WIDE_TABLE = FIXTURES / "jobs/wide-table.json"


@pytest.fixture(scope="session")
def basic():
    return pkm.Model()


@pytest.fixture(scope="session")
def corrected():
    return pkm.Model(table=WIDE_TABLE)


@pytest.fixture(scope="session")
def poses(basic):
    low, high = basic.pose_box.T
    return np.random.default_rng(20200513).uniform(low, high, (1000, 3))
