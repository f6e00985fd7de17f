"""What the tests share: files of the repository, public robot descriptions, the commands."""

import importlib
import json
import os
import subprocess
import tarfile
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
#: The folder of measured logs and public robot descriptions.
DATA = Path(os.environ.get("POWERBALL_DATA", ROOT.parent / "shared" / "data"))
BINARIES = Path(os.environ.get("POWERBALL_BIN", ROOT / "target" / "release"))
#: In CI nothing that can be installed may be missing.
REQUIRE_ALL = "REQUIRE_ALL" in os.environ


def need(module):
    """A module that some tests need."""
    if REQUIRE_ALL:
        return importlib.import_module(module)
    return pytest.importorskip(module, reason=f"{module} is not installed")


def command(name, *arguments):
    """Runs one of the commands."""
    path = BINARIES / name
    if not path.exists() and not REQUIRE_ALL:
        pytest.skip(f"{path} is not built: cargo build --release")
    return subprocess.run([path, *map(str, arguments)], capture_output=True, text=True)


@pytest.fixture(scope="session")
def public_urdf(tmp_path_factory):
    """A function that unpacks one of the public robot descriptions."""
    archive = DATA / "urdf.tar.xz"
    if not archive.exists():
        pytest.skip(f"{archive} is not there: POWERBALL_DATA names its folder")
    folder = tmp_path_factory.mktemp("urdf")

    def unpack(name):
        with tarfile.open(archive) as tar:
            text = tar.extractfile(name).read()
        path = folder / name
        path.write_bytes(text)
        return path

    return unpack


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def load(path):
    return json.loads(Path(path).read_text())
