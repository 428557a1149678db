"""Soil mechanics of the published `dem-triaxial` records."""

from itertools import pairwise

import numpy as np
import pytest
import xarray as xr

from granbench.data import load
from granbench.data.replicates import replicate_pairs, replicate_scatter
from granbench.data.splits import leak_report
from granbench.records import verify
from granbench.records.observations import (
    critical_states,
    initial_void_ratio_at,
    select,
    stress_ratio,
)
from granbench.tensors import deviatoric_stress, mean_stress

ANCHOR = {"loading_family": "constant-p", "initial_mean_stress": 0.5e6}
"""Compression test of the densest and the loosest specimen of each grading."""


@pytest.fixture(scope="module")
def shipped():
    return load("dem-triaxial")


@pytest.fixture(scope="module")
def anchors(shipped):
    """Triaxial compressions at 0.5 MPa of original specimens by grading: (dense, loose)."""
    tests = select(shipped, **ANCHOR, intermediate_stress_ratio=0.0, replicate=0)
    frictions = shipped["preparation_friction"].values
    ends = frictions.min(), frictions.max()
    pairs = {}
    for grading in np.unique(tests["grading"].values):
        found = [select(tests, grading=grading, preparation_friction=end) for end in ends]
        if all(records.sizes["path"] == 1 for records in found):
            pairs[str(grading)] = tuple(found)
    assert len(pairs) == 10
    return pairs


def critical_ratio(records: xr.Dataset) -> np.ndarray:
    states = critical_states(records)["stress"].values
    return deviatoric_stress(states) / mean_stress(states)


@pytest.fixture(scope="module")
def packing_scatter(shipped):
    """Standard deviations of critical q/p and e between packings prepared in the same way."""
    compressions = select(shipped, loading_family=("constant-p", "constant-sigma3"))
    rows = replicate_pairs(compressions)
    assert len(rows) >= 2
    ratio = critical_ratio(compressions)
    void_ratio = critical_states(compressions)["void_ratio"].values
    return tuple(
        float(np.sqrt(np.mean([(values[i] - values[j]) ** 2 for i, j in rows]) / 2.0))
        for values in (ratio, void_ratio)
    )


def test_the_file_is_complete_and_no_split_leaks(shipped):
    verify(shipped, "dem-triaxial")
    assert leak_report(shipped).clean


def test_every_family_and_pressure_is_in_every_split(shipped):
    assert shipped.sizes["path"] >= 420
    for split in ("train", "validation", "test", "ood-psd"):
        paths = select(shipped, split=split)
        assert len(set(paths["loading_family"].values)) == 4, split
        assert len(set(paths["initial_mean_stress"].values)) == 5, split
    assert set(shipped["split"].values[shipped["grading"].values == "fractal-1.5"]) == {"ood-psd"}


def test_quality_limits_hold_on_every_path(shipped):
    assert shipped["peak_inertial_number"].max() <= 2.5e-3
    assert shipped["servo_error_rms"].max() <= 0.01
    assert np.nanmax(shipped["stress_ratio_error_rms"]) <= 0.02
    assert shipped["box_edge_ratio"].min() >= 3.0
    assert shipped["stress"].min() > 0.0
    assert shipped.sizes["step"] > 200
    monotonic = select(shipped, loading_family=("constant-p", "constant-sigma3"))
    np.testing.assert_allclose(monotonic["strain"].isel(step=-1, component=0), 0.4, rtol=1e-5)


def test_void_ratio_follows_from_the_volumetric_strain(shipped):
    # (1 + e) = (1 + e0) exp(-eps_v) exactly; float32 leaves about 1e-6.
    start = shipped["void_ratio"].isel(step=0)
    expected = (1.0 + start) * np.exp(-shipped["strain"].sum("component")) - 1.0
    np.testing.assert_allclose(shipped["void_ratio"], expected.transpose("path", "step"), atol=5e-6)


def test_critical_stress_ratio_does_not_depend_on_the_initial_void_ratio(anchors, packing_scatter):
    scatter, _ = packing_scatter
    differences = np.array(
        [
            (critical_ratio(dense) - critical_ratio(loose)).item()
            for dense, loose in anchors.values()
        ]
    )
    # A difference of two packings has sqrt(2) times the scatter of one; 3 sigma a grading, and
    # no common sign: 3 sigma of the mean over all gradings.
    sigma = np.sqrt(2.0) * scatter
    assert np.abs(differences).max() <= 3.0 * sigma, differences
    assert abs(differences.mean()) <= 3.0 * sigma / np.sqrt(len(differences)), differences


def test_dense_and_loose_specimens_meet_in_void_ratio(anchors, packing_scatter):
    _, scatter = packing_scatter
    for grading, (dense, loose) in anchors.items():
        start = (loose["void_ratio"][:, 0].values - dense["void_ratio"][:, 0].values).item()
        end = critical_states(loose)["void_ratio"] - critical_states(dense)["void_ratio"].values
        assert start > 0.08, grading
        assert abs(end.item()) < max(0.15 * start, 4.0 * scatter), (grading, start, end.item())


def test_dense_specimens_peak_and_dilate_and_the_loosest_stay_near_critical(anchors):
    for grading, (dense, loose) in anchors.items():
        peak = stress_ratio(dense).max()
        assert peak > 1.25 * critical_ratio(dense).item(), grading
        dilation = (critical_states(dense)["void_ratio"] - dense["void_ratio"][:, 0].values).item()
        change = (critical_states(loose)["void_ratio"] - loose["void_ratio"][:, 0].values).item()
        assert dilation > 0.08, grading
        assert abs(change) < 0.5 * dilation, grading
        assert stress_ratio(loose).max() < 0.85 * peak, grading


def test_initial_void_ratio_rises_with_the_preparation_friction(shipped):
    # At one pressure, within twice the scatter between packings: frictions of 0, 0.005 and 0.01
    # make packings similar.
    slack = 2.0 * replicate_scatter(shipped).void_ratio_rms
    first = select(shipped, replicate=0)
    for grading in np.unique(first["grading"].values):
        void_ratio = initial_void_ratio_at(select(first, grading=grading), 0.5e6)
        by_friction = void_ratio.groupby("preparation_friction").mean().values
        assert by_friction.size == 7
        assert all(a < b + slack for a, b in pairwise(by_friction)), (grading, by_friction)
        assert by_friction[-1] > by_friction[0] + 0.08, (grading, by_friction)


def test_a_wide_grading_packs_denser_than_equal_spheres(shipped):
    compared = 0
    for wide in ("fractal-1.5", "fractal-2.9"):
        for friction in np.unique(shipped["preparation_friction"].values):
            for pressure in np.unique(shipped["initial_mean_stress"].values):
                alike = {"preparation_friction": friction, "initial_mean_stress": pressure}
                mono = select(shipped, grading="mono", **alike)["initial_void_ratio"].values
                other = select(shipped, grading=wide, **alike)["initial_void_ratio"].values
                if mono.size and other.size:
                    assert other.max() < mono.min() - 0.05
                    compared += 1
    assert compared >= 5


def test_compression_is_stronger_than_extension(shipped):
    monotonic = select(shipped, loading_family=("constant-p", "constant-sigma3"))
    ratio, b = critical_ratio(monotonic), monotonic["intermediate_stress_ratio"].values
    assert ratio[b == 0.0].mean() > 1.1 * ratio[b == 1.0].mean()
    assert ratio[b == 0.0].min() > ratio[b == 1.0].max()


def test_unloading_and_reloading_are_stiffer_than_first_loading(shipped):
    cyclic = select(shipped, loading_family="cyclic")
    strain = cyclic["strain"].values[..., 0].astype(float)
    stress = cyclic["stress"].values[..., 0].astype(float)
    stiffer = []
    for axial, sigma in zip(strain, stress, strict=True):
        increments = np.diff(axial)
        turns = np.flatnonzero(increments[1:] * increments[:-1] < 0.0) + 1
        assert turns.size >= 4
        unload, reload = turns[0], turns[1]
        first = (sigma[unload] - sigma[unload - 4]) / (axial[unload] - axial[unload - 4])
        # Two steps after the corner, where the record is rounded.
        again = (sigma[reload + 5] - sigma[reload + 2]) / (axial[reload + 5] - axial[reload + 2])
        stiffer.append(again > first)
    assert np.mean(stiffer) > 0.95


def test_lateral_stresses_agree_in_triaxial_compression(shipped):
    compression = select(shipped, intermediate_stress_ratio=0.0)
    lateral = compression["stress"].values[:, 20:, 1:]
    mean = compression["stress"].values[:, 20:].mean(-1)
    difference = np.abs(lateral[..., 0] - lateral[..., 1]) / mean
    assert np.sqrt(np.mean(difference**2)) < 0.01


def test_the_scatter_between_packings_is_known(shipped):
    scatter = replicate_scatter(shipped)
    assert scatter.specimens >= 10
    assert 0.0 < scatter.floor_mse < 0.05
