"""OpenMM contexts that several tests share; each takes a second or two to build."""

import numpy as np
import pytest
from bead_chains import ring_chain

from dnacheck.md.bead_chain import BeadChain, BeadEnergy
from dnacheck.md.minimise import find_minima


@pytest.fixture(scope="session")
def chain():
    return ring_chain()


@pytest.fixture(scope="session")
def energy(chain):
    return BeadEnergy(BeadChain(chain))


@pytest.fixture(scope="session")
def minima(energy):
    return find_minima(energy, np.random.default_rng(1))
