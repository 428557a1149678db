"""Folder of the published laboratory data."""

import os
from pathlib import Path

import pytest

SHARED = Path(__file__).parents[3] / "shared" / "data"
"""Next to the checkout; the data are not part of it."""


@pytest.fixture
def shared_data() -> Path:
    """The folder of published tests; CI has it, elsewhere what needs it is skipped."""
    if not SHARED.is_dir():
        missing = pytest.fail if os.environ.get("CI") else pytest.skip
        missing(f"the published laboratory data are not at {SHARED}")
    return SHARED
