"""How to add a dataset to a family that exists: one entry in its table."""

import pytest

from granbench.cli import main
from granbench.generators.classical.design import DATASETS, ClassicalDataset

NEW = ClassicalDataset(
    dataset="gp-ime-confined", model="ime", thesis_section="6.2.3", initial_mean_stress=2e5
)


def test_one_more_entry_is_one_more_dataset(tmp_path, monkeypatch):
    monkeypatch.setitem(DATASETS, NEW.dataset, NEW)
    for words in (
        ("generate", NEW.dataset, "--preset", "smoke", "--out", str(tmp_path), "--quiet"),
        ("data", "verify", str(tmp_path / "gp-ime-confined-0.0.0+smoke.nc")),
    ):
        with pytest.raises(SystemExit) as left:
            main(list(words))
        assert left.value.code == 0
