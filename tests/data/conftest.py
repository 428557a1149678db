"""Fixtures of the data tests."""

import pytest
from registered import Shelf, make_shelf


@pytest.fixture
def shelf(tmp_path, monkeypatch) -> Shelf:
    return make_shelf(tmp_path, monkeypatch)
