"""Datasets in the plane: what adapters, summary, card and mini tier make of them."""

import re

import numpy as np
import pytest
import torch
import xarray as xr
from plane_records import plane_records
from torch.utils.data import DataLoader

from granbench.data.adapters import WindowDataset, conditions_of, history_of, history_of_batch
from granbench.data.card import PLANE_FIGURES, write_card
from granbench.data.card_text import card_text
from granbench.data.normalisation import Normalisation
from granbench.data.publish import MINI_PATHS, make_mini
from granbench.data.splits import split_names
from granbench.data.strain_paths import strain_path_statistics
from granbench.data.summary import summarise
from granbench.records import describe, seal, validate_records


@pytest.fixture
def records():
    return plane_records("gp-dp")


@pytest.fixture
def with_internals(records):
    """The records with two internal variables, one of which never changes."""
    series = ("path", "step")
    shape = tuple(records.sizes[name] for name in series)
    voids = np.random.default_rng(0).uniform(0.5, 0.9, shape)
    return describe(
        records.assign(void_ratio=(series, voids), hardening=(series, np.full(shape, 0.25)))
    )


@pytest.mark.parametrize("start", [0, 13])
def test_conditions_hold_every_internal_variable_of_their_step(with_internals, start) -> None:
    conditions = conditions_of(with_internals, start)
    for name in ("void_ratio", "hardening"):
        known = with_internals[name].values[:, start].astype(np.float64)
        np.testing.assert_array_equal(conditions.require(name).numpy(), known)
    assert torch.equal(conditions.require("initial_void_ratio"), conditions.require("void_ratio"))


def test_history_and_windows_hold_every_internal_variable(with_internals) -> None:
    history = history_of(with_internals)
    assert set(history.internals) == {"void_ratio", "hardening"}
    windows = WindowDataset(with_internals, length=20, stride=20, dtype=torch.float64)
    batch = next(iter(DataLoader(windows, batch_size=len(windows))))
    cut = history_of_batch(batch, windows.order)
    second = slice(1, None, len(windows.starts))
    for name, series in history.internals.items():
        torch.testing.assert_close(cut.internals[name][second], series[:, 20:41])
        torch.testing.assert_close(cut.conditions.require(name)[second], series[:, 20])


def test_an_internal_variable_may_be_constant_but_a_stress_may_not(with_internals) -> None:
    normalisation = Normalisation.from_training(with_internals)
    assert normalisation.std["hardening"] == 0.0
    assert normalisation.std["stress"].shape == (3,)
    assert "tangent" not in normalisation.std


def test_statistics_are_those_of_the_paths(records) -> None:
    found = strain_path_statistics(records)
    strain = records["strain"].values.astype(float)
    step = np.diff(strain, axis=1)
    norm = np.sqrt(step[..., 0] ** 2 + step[..., 1] ** 2 + 2.0 * step[..., 2] ** 2)
    assert found.median_increment == pytest.approx(np.median(norm))
    assert found.strain_std["xy"] == pytest.approx(strain[..., 2].std())
    assert found.largest_strain == np.abs(strain).max()
    assert 0.0 < found.median_volumetric_factor <= 1.0
    assert found.tensile_share == 0.0  # the cone of Drucker-Prager holds no tension
    tensile = strain_path_statistics(plane_records("gp-csuh")).tensile_share
    stress = plane_records("gp-csuh")["stress"].values.astype(float)
    tensors = stress[..., [0, 2, 2, 1]].reshape(*stress.shape[:-1], 2, 2)
    assert tensile == pytest.approx((np.linalg.eigvalsh(tensors)[..., 0] < 0.0).mean())
    unstressed = strain_path_statistics(plane_records("gp-j2"))
    assert unstressed.median_volumetric_factor is None
    assert unstressed.tensile_share is None


def test_summary_describes_strain_paths_and_no_packings(records) -> None:
    summary = summarise(records)
    assert summary["component_order"] == "plane"
    assert tuple(summary["strain_paths"]) == split_names(records)
    assert sum(found["paths"] for found in summary["strain_paths"].values()) == summary["paths"]
    assert "replicate_scatter" not in summary
    assert summary["pressures"] == [1e5]


def test_card_shows_the_figures_of_the_plane(records, tmp_path) -> None:
    page = write_card(seal(records), tmp_path)
    text = page.read_text()
    addresses = re.findall(r"!\[\]\((.*?)\)", text)
    assert len(addresses) == len(PLANE_FIGURES)
    assert all((tmp_path / address).read_bytes().startswith(b"\x89PNG") for address in addresses)
    assert "left out" not in text
    assert "Tests by family and pressure" not in text
    assert "packing" not in text.split("## Variables")[0]
    rows = [line for line in text.split("## Strain paths")[1].splitlines() if line.startswith("| ")]
    assert [row.split("|")[1].strip() for row in rows[2:10]] == list(split_names(records))
    assert records.attrs["admissible_scaling"] in text


def test_card_of_unscaled_paths_does_not_speak_of_scaling() -> None:
    text = card_text(seal(plane_records("gp-j2")), {})
    assert "Admissible paths" not in text
    assert "volumetric factor" not in text


def test_card_states_the_model_and_the_rounding() -> None:
    text = card_text(seal(plane_records("gp-j2")), {})
    truth = text.split("## Ground truth")[1].split("##")[0]
    assert "the model `j2`" in truth
    assert "| bulk modulus | 1.25e+06 | Pa |" in truth
    assert "16 bits of mantissa" in text.split("## Rounding")[1].split("##")[0]
    assert "## Tangents" not in text  # the smoke preset has them
    assert "`granbench generate gp-j2 --preset smoke`" in text


def test_mini_tier_has_paths_of_every_split(records) -> None:
    """All paths of a small dataset are taken: the number has only an upper bound."""
    mini = make_mini(records)
    validate_records(mini)
    assert split_names(mini) == split_names(records)
    assert mini.sizes["path"] == records.sizes["path"]
    more = xr.concat(
        [records.assign_coords(specimen=records["specimen"] + str(again)) for again in range(12)],
        "path",
    )
    counts = np.unique(make_mini(more)["split"].values, return_counts=True)
    assert dict(zip(*counts, strict=True)) == dict.fromkeys(split_names(records), 8) | MINI_PATHS
