"""What tests of several rooms share: real data beside the checkout, the bundled takes, the default face."""

from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
DATA = REPOSITORY.parent / "shared" / "data"


def data_file(name: str) -> Path:
    """A third-party file that lies beside the checkout; the test is skipped where it is absent."""
    file = DATA / name
    if not file.is_file():
        pytest.skip(f"{name} is not here")
    return file


@pytest.fixture(scope="session")
def signer_pose() -> Path:
    """A real signer: MediaPipe landmarks of a clip of the public DGS corpus."""
    return data_file("dgs_example.pose")


@pytest.fixture(scope="session")
def eaf_schema():
    """ELAN's schema of EAF 3.0."""
    from lxml import etree

    return etree.XMLSchema(etree.parse(str(data_file("EAFv3.0.xsd"))))


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
