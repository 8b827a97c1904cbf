"""What the tests of the installed wheel share."""

from pathlib import Path

import pytest

import tauscope

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def data() -> Path:
    """The recordings and robots that come with the project."""
    return ROOT / "tests" / "data"


@pytest.fixture(scope="session")
def concealed(data: Path, tmp_path_factory: pytest.TempPathFactory) -> tauscope.Simulation:
    """Recordings of an arm with one physical effect that its URDF does not have."""
    out = tmp_path_factory.mktemp("concealed")
    return tauscope.simulate(data / "concealed.scenario.yaml", out=out)
