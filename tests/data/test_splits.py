"""Laws of splits, normalisation and replicate scatter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_records import synthetic_records

from granbench.data.normalisation import Normalisation
from granbench.data.replicates import replicate_pairs, replicate_scatter
from granbench.data.splits import leak_report, select_split, split_hash, split_names
from granbench.data.summary import summarise
from granbench.errors import DatasetError, RegistryError
from granbench.records import SCHEMA, validate_records


def relabelled(ds, name, values):
    return ds.assign_coords({name: ("path", values, ds[name].attrs)})


def test_splits_partition_the_paths(records):
    parts = [select_split(records, name)["path_id"].values for name in split_names(records)]
    assert sorted(np.concatenate(parts)) == sorted(records["path_id"].values)


SMALL = synthetic_records(n_specimens=5, steps=2)


@settings(max_examples=20, deadline=None)
@given(order=st.permutations(range(SMALL.sizes["path"])))
def test_split_hash_does_not_depend_on_the_order_of_paths(order):
    assert split_hash(SMALL.isel(path=order)) == split_hash(SMALL)


def test_split_hash_changes_with_one_path(records):
    split = records["split"].values.copy()
    split[0] = "test"
    assert split_hash(relabelled(records, "split", split)) != split_hash(records)


def test_a_sound_dataset_has_no_leak(records):
    report = leak_report(records)
    assert report.clean
    assert set(report.nearest_path_distance) == {
        "train-validation",
        "train-test",
        "train-ood-psd",
        "validation-test",
        "validation-ood-psd",
        "test-ood-psd",
    }
    assert min(report.nearest_path_distance.values()) > 0.0


def test_each_kind_of_leak_is_found(records):
    specimen = records["specimen"].values
    split = records["split"].values.copy()
    split[np.argmax(specimen == "mono-f0-r0")] = "test"
    report = leak_report(relabelled(records, "split", split))
    assert report.shared_specimens == ("mono-f0-r0",)
    assert report.shared_preparations == ("mono, mu0 = 0",)

    # The replicate of a training packing as a test: other specimen, same preparation.
    split = np.where(specimen == "mono-f0-r1", "test", records["split"].values)
    report = leak_report(relabelled(records, "split", split))
    assert report.shared_specimens == ()
    assert report.shared_preparations == ("mono, mu0 = 0",)

    test_row = int(np.argmax(records["split"].values == "test"))
    for name in ("strain", "stress"):
        records[name].values[test_row] = records[name].values[0]
    report = leak_report(records)
    assert not report.clean
    ids = records["path_id"].values
    assert report.identical_paths == ((ids[0], ids[test_row]),)
    assert report.nearest_path_distance["train-test"] == pytest.approx(0.0, abs=1e-6)


def test_normalisation_sees_the_training_split_only(records):
    before = Normalisation.from_training(records)
    others = records["split"].values != "train"
    records["stress"].values[others] *= 100.0
    after = Normalisation.from_training(records)
    np.testing.assert_array_equal(before.std["stress"], after.std["stress"])
    training = records["stress"].values[~others].astype(np.float64)
    np.testing.assert_allclose(after.mean["stress"], training.mean((0, 1)))
    np.testing.assert_allclose(after.std["stress"], training.std((0, 1)))
    assert after.std["void_ratio"].shape == ()


def test_normalisation_needs_training_paths_that_vary(records):
    with pytest.raises(RegistryError, match="no split 'train'"):
        Normalisation.from_training(select_split(records, "test"))
    records["void_ratio"].values[:] = 0.5
    with pytest.raises(DatasetError, match="'void_ratio' has a component that never varies"):
        Normalisation.from_training(records)


def test_replicates_are_paired_by_loading(records):
    pairs = replicate_pairs(records)
    assert len(pairs) == 10
    for original, again in pairs:
        assert records["programme"].values[original] == records["programme"].values[again]
        assert records["split"].values[original] == records["split"].values[again]
        assert (records["replicate"].values[original], records["replicate"].values[again]) == (0, 1)


def test_scatter_of_a_known_offset(records):
    """Every component off by one standard deviation: RMS 1, MSE 1, and half of it the floor."""
    std = Normalisation.from_training(records).std["stress"]
    for original, again in replicate_pairs(records):
        for name in ("stress", "void_ratio"):
            records[name].values[again] = records[name].values[original]
        records["stress"].values[again] += std
        records["void_ratio"].values[again] += 0.01
    scatter = replicate_scatter(records, normalisation=_with(std))
    assert scatter.stress_rms == pytest.approx((1.0, 1.0, 1.0), rel=1e-4)
    assert scatter.stress_mse == pytest.approx(1.0, rel=1e-4)
    assert scatter.floor_mse == pytest.approx(0.5, rel=1e-4)
    assert scatter.void_ratio_rms == pytest.approx(0.01, rel=1e-4)
    assert (scatter.pairs, scatter.specimens) == (10, 2)


def _with(std):
    return Normalisation(mean={}, std={"stress": std})


def test_the_mean_of_packings_scores_the_floor():
    """The law behind `floor_mse`: half the mean square difference is the variance about the mean.

    Tolerance: 20,000 pairs of unit scatter have a sampling error of about one percent.
    """
    rng = np.random.default_rng(0)
    packings = rng.normal(size=(2, 20_000))
    difference = ((packings[0] - packings[1]) ** 2).mean()
    assert difference / 2.0 == pytest.approx((packings**2).mean(), rel=0.03)


def test_without_replicates_there_is_no_scatter(records):
    first = records.isel(path=np.flatnonzero(records["replicate"].values == 0))
    with pytest.raises(DatasetError, match="no replicates"):
        replicate_scatter(first)
    assert summarise(first)["replicate_scatter"] is None


def test_summary_counts_everything_once(records):
    summary = summarise(records)
    assert sum(split["paths"] for split in summary["splits"].values()) == summary["paths"]
    assert sum(split["specimens"] for split in summary["splits"].values()) == summary["specimens"]
    assert sum(summary["families"].values()) == summary["paths"]
    assert summary["quality"]["max_peak_inertial_number"] == pytest.approx(
        float(records["inertial_number"].max())
    )
    assert summary["quality"]["min_box_edge_ratio"] > 3.0


def test_summary_of_records_with_the_required_variables_only(records):
    names = [name for name, spec in SCHEMA.items() if spec.required]
    bare = records.drop_vars([name for name in records.variables if name not in names])
    validate_records(bare)
    summary = summarise(bare)
    assert summary["quality"] == {}
    assert "gradings" not in summary
    assert summary["leaks"]["shared_preparations"] == ()
