"""Initial packings: no contact, even across periodic faces; exact lattices."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from granbench.errors import ConfigurationError
from granbench.generators.dem.diameters import realise_grading
from granbench.generators.dem.gradings import GRADINGS
from granbench.generators.dem.packing import (
    default_solid_fraction,
    face_centred_cubic,
    place_grains,
    simple_cubic,
)


def smallest_gap(positions, diameters, box_edges):
    """Smallest surface distance over all pairs and all 27 images, by brute force."""
    offset = positions[:, None, :] - positions[None, :, :]
    reach = 0.5 * (diameters[:, None] + diameters[None, :])
    smallest = np.inf
    for image in itertools.product((-1, 0, 1), repeat=3):
        gap = np.linalg.norm(offset + np.array(image) * box_edges, axis=-1) - reach
        if image == (0, 0, 0):
            np.fill_diagonal(gap, np.inf)
        smallest = min(smallest, gap.min())
    return smallest


@pytest.mark.parametrize("name", GRADINGS)
def test_grains_do_not_touch_even_across_periodic_faces(name):
    rng = np.random.default_rng(3)
    grading = realise_grading(GRADINGS[name], 600, rng)
    fraction = default_solid_fraction(grading)
    if name in ("fractal-2.5", "fractal-2.9"):
        fraction = 0.30  # 600 grains this wide fill a box of less than two d_max at 0.40
    positions, box_edge = place_grains(grading.diameters, fraction, rng)
    assert positions.shape == (600, 3)
    assert np.all((positions >= 0.0) & (positions < box_edge))
    assert smallest_gap(positions, grading.diameters, box_edge) >= 0.0
    assert grading.solid_volume / box_edge**3 == pytest.approx(fraction, rel=1e-12)


@given(
    diameters=st.lists(st.floats(0.01, 0.1), min_size=1, max_size=60).map(np.array),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=40, deadline=None)
def test_any_loose_set_of_grains_is_placed_without_contact(diameters, seed):
    fraction = min(0.15, 0.9 * math.pi / 48.0 * np.sum(diameters**3) / diameters.max() ** 3)
    positions, box_edge = place_grains(diameters, fraction, np.random.default_rng(seed))
    assert smallest_gap(positions, diameters, box_edge) >= 0.0


def test_positions_are_uniform_over_the_cube():
    """Grains are equally frequent in the eight octants of the cube."""
    diameters = np.full(2000, 0.01)
    positions, box_edge = place_grains(diameters, 0.25, np.random.default_rng(0))
    counts, _ = np.histogramdd(positions, bins=2, range=[(0.0, box_edge)] * 3)
    # Excluded volume makes the counts vary less than independent draws, whose deviation is 15.
    np.testing.assert_allclose(counts, 250, atol=45)


def test_placement_is_reproducible_from_the_seed():
    diameters = realise_grading(GRADINGS["fractal-1.5"], 800, np.random.default_rng(0)).diameters
    first, again, other = (
        place_grains(diameters, 0.4, np.random.default_rng(seed))[0] for seed in (5, 5, 6)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_wide_gradings_start_denser_than_narrow_ones():
    fractions = {
        name: default_solid_fraction(realise_grading(spec, 1000, np.random.default_rng(0)))
        for name, spec in GRADINGS.items()
    }
    narrow = {name for name, fraction in fractions.items() if fraction == 0.30}
    assert narrow == {"bell", "mono", "linear", "fractal-m5.0"}
    assert {fractions[name] for name in fractions.keys() - narrow} == {0.40}


def test_placement_without_free_positions_is_refused():
    with pytest.raises(ConfigurationError, match="solid_fraction"):
        place_grains(np.full(200, 0.01), 0.5, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("diameters", "fraction", "named"),
    [
        (np.full(200, 0.01), 0.0, "solid_fraction"),
        (np.full(200, 0.01), 1.0, "solid_fraction"),
        (np.full(200, 0.01), math.nan, "solid_fraction"),
        (np.array([]), 0.3, "diameters"),
        (np.array([0.01, -0.01]), 0.3, "diameters"),
        (np.array([0.01, math.inf]), 0.3, "diameters"),
        (np.full(2, 0.01), 0.3, "particle_count"),
    ],
)
def test_impossible_packing_is_refused_by_field(diameters, fraction, named):
    with pytest.raises(ConfigurationError, match=named):
        place_grains(diameters, fraction, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("lattice", "neighbours", "solid_fraction", "grains_per_cell"),
    [
        (simple_cubic, 6, math.pi / 6.0, 1),
        (face_centred_cubic, 12, math.pi / math.sqrt(18.0), 4),
    ],
)
def test_lattice_has_its_coordination_and_density(
    lattice, neighbours, solid_fraction, grains_per_cell
):
    diameter = 0.01
    positions, edges = lattice((3, 4, 5), diameter)
    assert positions.shape == (60 * grains_per_cell, 3)
    assert np.all((positions >= 0.0) & (positions < edges))
    offset = positions[:, None, :] - positions[None, :, :]
    offset -= edges * np.round(offset / edges)
    distance = np.linalg.norm(offset, axis=-1)
    np.fill_diagonal(distance, np.inf)
    assert distance.min() == pytest.approx(diameter, rel=1e-12)
    np.testing.assert_array_equal((distance < 1.001 * diameter).sum(axis=1), neighbours)
    volume = len(positions) * math.pi / 6.0 * diameter**3
    assert volume / np.prod(edges) == pytest.approx(solid_fraction, rel=1e-12)


@pytest.mark.parametrize("lattice", [simple_cubic, face_centred_cubic])
def test_lattice_takes_one_number_for_a_cube(lattice):
    positions, edges = lattice(2, 0.01)
    same, same_edges = lattice((2, 2, 2), 0.01)
    np.testing.assert_array_equal(positions, same)
    np.testing.assert_array_equal(edges, same_edges)
    with pytest.raises(ConfigurationError, match="cells"):
        lattice(0, 0.01)
    with pytest.raises(ConfigurationError, match="diameter"):
        lattice(2, 0.0)
