"""Statistics of the strain paths in the published `gp-*` records, compared with the thesis."""

import json

import numpy as np
import pytest
from gp_records import NAMES, series, shipped, split_rows
from scipy import stats

from granbench.data import entry, load
from granbench.data.fetch import checkout_datasets
from granbench.data.registry import entries
from granbench.data.splits import leak_report, split_names
from granbench.generators.classical.design import CORE, OUT_OF_DISTRIBUTION
from granbench.paths.drawn import STRAIN_GRID
from granbench.tensors import frobenius_norm, volumetric_strain

PUBLISHED_PATHS = 201
PUBLISHED = {"increment": 1.28e-3, "xx": 0.054, "yy": 0.056, "xy": 0.033, "largest": 0.233}
"""Statistics of the paths that the author of the thesis published; see `test_gaussian.py`."""


@pytest.fixture(scope="module")
def training() -> np.ndarray:
    """Strains of the training paths as they were drawn, (path, step, component)."""
    records = shipped("gp-j2")
    return series(records, "strain")[split_rows(records, "train")]


def training_values(name: str) -> np.ndarray:
    records = shipped("gp-j2")
    return records[name].values[split_rows(records, "train")]


@pytest.mark.parametrize("name", NAMES)
def test_core_has_its_paths_and_steps(name: str) -> None:
    records = shipped(name)
    expected = {"train": 1000, "validation": 200, "test": 200}
    expected |= dict.fromkeys(OUT_OF_DISTRIBUTION, 50)
    expected |= {"ood-unscaled": 50} if name == "gp-dp" else {}
    counts = np.unique(records["split"].values.astype(str), return_counts=True)
    assert dict(zip(*counts, strict=True)) == expected
    assert records.sizes["step"] == CORE.steps + 1
    assert json.loads(records.attrs["configuration"])["seed"] == 0


def test_reference_data_stay_small() -> None:
    """A clone has at most 60 MB of data; a `gp-*` file has at most 7 MB, all five 27 MB."""
    sizes = {one.id: one.bytes for one in entries() if one.tier == "core"}
    assert sum(sizes.values()) <= 60e6
    assert max(sizes[name] for name in NAMES) <= 7e6
    assert sum(sizes[name] for name in NAMES) <= 27e6
    folder = checkout_datasets()
    assert folder is not None
    for name in NAMES:
        assert (folder / entry(name).file).stat().st_size == sizes[name]


@pytest.mark.parametrize("name", NAMES)
def test_every_path_starts_at_zero_on_the_grid(name: str) -> None:
    strain = series(shipped(name), "strain")
    assert (strain[:, 0] == 0.0).all()
    np.testing.assert_array_equal(strain, np.round(strain / STRAIN_GRID) * STRAIN_GRID)


@pytest.mark.parametrize("name", NAMES)
def test_no_path_is_in_two_splits(name: str) -> None:
    report = leak_report(shipped(name))
    assert report.clean
    # In standard deviations of strain and stress; repeated with rounding it would be 1e-4.
    assert min(report.nearest_path_distance.values()) > 0.05


def test_median_increment_is_that_of_figure_6_7(training: np.ndarray) -> None:
    median = np.median(frobenius_norm(np.diff(training, axis=1), "plane"))
    assert median == pytest.approx(1.3e-3, rel=0.05)  # printed with two digits
    # With the whole of v as standard deviation it would be twice that.


def test_published_paths_are_like_sets_of_ours(training: np.ndarray) -> None:
    """Each of five statistics, within three standard deviations between sets of 201 paths.

    The published norm of the increment counts the shear strain once.
    """
    norms = np.linalg.norm(np.diff(training, axis=1), axis=-1)

    def figures(rows: np.ndarray) -> list[float]:
        components = training[rows].std(axis=(0, 1))
        return [np.median(norms[rows]), *components, np.abs(training[rows]).max()]

    sets = np.random.default_rng(0).integers(len(training), size=(100, PUBLISHED_PATHS))
    ours = np.array([figures(rows) for rows in sets])
    for name, mean, scatter in zip(PUBLISHED, ours.mean(0), ours.std(0), strict=True):
        assert PUBLISHED[name] == pytest.approx(mean, abs=3.0 * scatter), name


def test_parameters_are_uniform_over_their_ranges_and_independent() -> None:
    """Kolmogorov-Smirnov over the 1000 training paths; one sample, so p > 0.1 % each."""
    ranges = {
        "strain_deviation": (0.05, 0.09),  # v / 2, v from 0.1 to 0.18
        "correlation_length": (0.1, 0.5),
        "rotation_deviation": (0.0, np.pi / 8.0),  # v_theta / 2
        "initial_angle": (-np.pi, np.pi),
    }
    drawn = {name: training_values(name) for name in ranges}
    for name, (low, high) in ranges.items():
        assert stats.kstest(drawn[name], stats.uniform(low, high - low).cdf).pvalue > 1e-3, name
    correlations = np.corrcoef(list(drawn.values()))[np.triu_indices(len(ranges), 1)]
    assert np.abs(correlations).max() < 4.0 / np.sqrt(1000.0)  # of independent ones: 1/sqrt(n)


def test_amplitude_and_memory_are_those_of_the_drawn_parameters(training: np.ndarray) -> None:
    """For eps_1 + eps_2, which does not depend on the rotation: Eq 6.25 at lag 0 and one half.

    var f(t) = 2 s^2 (1 - exp(-t^2/l^2)), and cov(f(1), f(1/2)) likewise; over 1000 paths scaled
    to unit variance a second moment scatters by sqrt(2/1000) = 4.5 %: three times that.
    """
    s, length = training_values("strain_deviation"), training_values("correlation_length")

    def covariance(one: float, other: float) -> np.ndarray:
        free = np.exp(-((one - other) ** 2) / (2.0 * length**2))
        start = np.exp(-(one**2 + other**2) / (2.0 * length**2))
        return 2.0 * s**2 * (free - start)

    volumetric = volumetric_strain(training, "plane")
    end, middle = volumetric[:, -1], volumetric[:, CORE.steps // 2]
    assert (end**2 / covariance(1.0, 1.0)).mean() == pytest.approx(1.0, abs=0.135)
    assert (middle**2 / covariance(0.5, 0.5)).mean() == pytest.approx(1.0, abs=0.135)
    scale = np.sqrt(covariance(1.0, 1.0) * covariance(0.5, 0.5))
    expected = (covariance(1.0, 0.5) / scale).mean()
    assert (end * middle / scale).mean() == pytest.approx(expected, abs=0.135)


def test_paths_are_smooth_to_the_grid(training: np.ndarray) -> None:
    """No jitter: third differences of eps_1 + eps_2 are those of the process and of the grid.

    A process of deviation s has third derivatives of deviation sqrt(15) s/l^3. The rounding of
    two components to the grid adds sqrt(20) 2^-20 sqrt(2/12). A diagonal jitter of 1e-6, which a
    Cholesky factor needs, would add sqrt(20) 1e-3 s = 3e-4, a hundred times that.
    """
    s, length = training_values("strain_deviation"), training_values("correlation_length")
    third = np.diff(volumetric_strain(training, "plane"), n=3, axis=1)
    process = np.sqrt(2.0 * 15.0) * s / length**3 / CORE.steps**3
    grid = np.sqrt(20.0 * 2.0 / 12.0) * STRAIN_GRID
    ratio = third.std(axis=1) / np.hypot(process, grid)
    # Over one path the deviation itself scatters; a path with l = 0.5 has few bends.
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1)
    assert ratio.max() < 2.5


@pytest.mark.parametrize("name", [name for name in NAMES if name != "gp-j2"])
def test_all_models_follow_the_same_paths(name: str) -> None:
    """To the last bit where nothing is scaled, else in everything but the volume change."""
    ours, theirs = (
        shipped("gp-j2"),
        shipped(name).isel(path=slice(0, shipped("gp-j2").sizes["path"])),
    )
    np.testing.assert_array_equal(ours["path_id"].values, theirs["path_id"].values)
    strain, other = series(ours, "strain"), series(theirs, "strain")
    if "volumetric_factor" not in theirs.coords:
        np.testing.assert_array_equal(strain, other)
        return
    factor = theirs["volumetric_factor"].values[:, None]
    two_roundings = {"rtol": 0.0, "atol": 2.0 * STRAIN_GRID}
    np.testing.assert_allclose(other[..., 2], strain[..., 2], **two_roundings)
    np.testing.assert_allclose(
        other[..., 0] - other[..., 1], strain[..., 0] - strain[..., 1], **two_roundings
    )
    np.testing.assert_allclose(
        volumetric_strain(other, "plane"), factor * volumetric_strain(strain, "plane"),
        **two_roundings,
    )  # fmt: skip
    assert 0.0 <= factor.min() < factor.max() == 1.0


def test_splits_out_of_distribution_differ_as_their_names_say() -> None:
    records = shipped("gp-j2")
    strain = series(records, "strain")
    by_split = {name: strain[split_rows(records, name)] for name in split_names(records)}
    speed = {
        name: np.median(frobenius_norm(np.diff(paths, axis=1), "plane"))
        for name, paths in by_split.items()
    }
    largest = {name: np.abs(paths).max() for name, paths in by_split.items()}
    assert speed["test"] == pytest.approx(speed["train"], rel=0.1)
    assert speed["ood-rougher"] > 4.0 * speed["train"]
    assert largest["ood-rougher"] < 1.1 * largest["train"]
    assert 1.6 < speed["ood-amplitude"] / speed["train"] < 2.4
    assert largest["ood-amplitude"] > 1.2 * largest["train"]
    ends = by_split["ood-proportional"][:, -1:]
    line = np.linspace(0.0, 1.0, CORE.steps + 1)[:, None] * ends
    np.testing.assert_allclose(by_split["ood-proportional"], line, atol=STRAIN_GRID)
    rows = split_rows(records, "ood-cyclic")
    distance = frobenius_norm(by_split["ood-cyclic"], "plane")
    amplitude = records["strain_amplitude"].values[rows]
    assert (distance.max(axis=1) <= amplitude + 2.0 * STRAIN_GRID).all()
    assert set(records["strain_cycles"].values[rows]) <= {2.0, 3.0, 4.0, 5.0}


def test_mini_tier_is_a_part_of_core() -> None:
    """Every split, and the very values; the wheel has it, so it needs no checkout."""
    core = shipped("gp-j2")
    with load("gp-j2-mini") as mini:
        assert split_names(mini) == split_names(core)
        assert 100 <= mini.sizes["path"] <= 200
        rows = np.searchsorted(np.sort(core["path_id"].values), mini["path_id"].values)
        rows = np.argsort(core["path_id"].values)[rows]
        for name in ("strain", "stress", "split", "correlation_length"):
            np.testing.assert_array_equal(mini[name].values, core[name].values[rows])
        assert core.attrs["content_sha256"] in mini.attrs["derived_from"]
