"""The registered commands make the committed `gp-*` files again."""

import json

import numpy as np
import pytest
from gp_records import NAMES, series, shipped

from granbench.data import entry, split_hash
from granbench.generators.find import find_generator
from granbench.records import open_records


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_registered_command_makes_the_committed_file_again(name: str, tmp_path) -> None:
    """Exact on one kind of machine, and very likely exact on another, because of the rounding.

    On another machine exp and matmul may differ in their last bit, by 1e-16, so that about one
    value in 10^9 is rounded to the other side: a strain then differs by one grid step, 1e-6, and
    the stress from there on by about 1e-5 of its standard deviation.
    """
    assert entry(name).generator == f"granbench generate {name} --preset core --out DIR"
    path, _ = find_generator(name).generate(name, "core", tmp_path, progress="quiet")
    committed = shipped(name)
    with open_records(path) as made:
        assert set(made.variables) == set(committed.variables)
        assert split_hash(made) == entry(name).split_sha256
        mine, theirs = (json.loads(ds.attrs["configuration"]) for ds in (made, committed))
        assert mine == theirs
        for variable in committed.data_vars:
            again, kept = series(made, str(variable)), series(committed, str(variable))
            assert (again != kept).mean() < 1e-4, variable
            np.testing.assert_allclose(again, kept, rtol=0.0, atol=1e-3 * kept.std() + 1e-12)
