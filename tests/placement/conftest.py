"""Two actors who do not exist, for the tests of this folder."""

import pytest

from signface.synth.actors import draw_actors


@pytest.fixture(scope="session")
def actors(face):
    return draw_actors(face, 2, seconds=12.0, seed=5)
