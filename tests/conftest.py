"""What tests of several rooms share: files of others, the bundled takes, the default face."""

from pathlib import Path

import pytest

from tests.fixtures.third_party import FILES, FOLDER, absent, third_party_file

REPOSITORY = Path(__file__).resolve().parents[1]


def pytest_terminal_summary(terminalreporter):
    """Say once what was not tested for want of a file."""
    if names := absent():
        terminalreporter.section("files of others that are not here: tests that need them were skipped")
        for name in names:
            terminalreporter.line(f"{FOLDER / name}: {FILES[name][1]}")


@pytest.fixture(scope="session")
def signer_pose() -> Path:
    """A real signer: MediaPipe landmarks of a clip of the public DGS corpus."""
    return third_party_file("dgs_example.pose")


@pytest.fixture(scope="session")
def eaf_schema():
    """ELAN's schema of EAF 3.0."""
    from lxml import etree

    return etree.XMLSchema(etree.parse(str(third_party_file("EAFv3.0.xsd"))))


@pytest.fixture(scope="session")
def mini():
    """The bundled synthetic corpus."""
    from signface.corpus.manifest import read_corpus

    return read_corpus(REPOSITORY / "corpora" / "mini")


@pytest.fixture(scope="session")
def face():
    """The default face."""
    from signface.face.reading import read_face

    return read_face("default")


@pytest.fixture(scope="session")
def nodding():
    """Two seconds of weights in which the head nods and rises: 50 Hz, some frames unknown."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    from signface.descriptors import Descriptors

    time = np.arange(100) / 50
    head = np.tile(np.eye(4), (100, 1, 1))
    head[:, :3, :3] = Rotation.from_euler("x", 20 * np.sin(time)[:, None], degrees=True).as_matrix()
    head[:, 1, 3] = 5 * time
    weights = np.stack([time / 2, np.cos(time)], axis=1)
    residual = 0.1 + time / 10
    for array in (weights, residual, head):
        array[7:9] = np.nan
    return Descriptors(weights, ("jawOpen", "browInnerUp"), 50.0, 0.0, residual, head, "nodding", ("made",))
