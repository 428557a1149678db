"""Mesh and operators: what holds for every element."""

import numpy as np
import pytest
import skfem
from plane_bodies import LAME, SHEAR, STIFFNESS, Body, bounded_by, distorted, elastic_cell

from granbench.errors import ConfigurationError
from granbench.fem import ImplicitSettings, PlaneMesh, rectangle, run
from granbench.fem.mesh import ELEMENTS
from granbench.fem.operators import build_operators

ROUNDING = 1e-12
"""Relative: sums of some hundred products in double precision."""

GRADIENT = np.array([[0.03, 0.01], [0.02, -0.05]])
STRAIN = -np.array([GRADIENT[0, 0], GRADIENT[1, 1], 0.5 * (GRADIENT[0, 1] + GRADIENT[1, 0])])
"""Strain of the displacement GRADIENT @ x, compression positive."""

each_element = pytest.mark.parametrize("element", ELEMENTS)
with_and_without_b_bar = pytest.mark.parametrize("b_bar", [False, True])


def affine(mesh: PlaneMesh) -> np.ndarray:
    return (mesh.nodes @ GRADIENT.T).T.ravel()


@each_element
def test_patch_test_holds_to_machine_precision(element: str) -> None:
    mesh = distorted(element)
    loading = bounded_by(lambda x: x @ GRADIENT[0], lambda x: x @ GRADIENT[1])
    settings = ImplicitSettings(steps=1, tolerance=1e-13)
    found = run(Body(loading), elastic_cell(), solver=settings, mesh=mesh).check()
    scale = np.abs(STIFFNESS @ STRAIN).max()
    wrong = found["stress"].values[-1] - STIFFNESS @ STRAIN
    assert np.abs(wrong).max() < ROUNDING * scale
    moved = found["displacement"].values[-1].T.ravel()
    np.testing.assert_allclose(moved, affine(mesh), atol=ROUNDING)


@each_element
@with_and_without_b_bar
def test_compression_is_positive(element: str, b_bar: bool) -> None:
    mesh = distorted(element)
    operators = build_operators(mesh, b_bar=b_bar)
    strain = (operators.strain @ affine(mesh)).reshape(3, -1)
    np.testing.assert_allclose(strain.T, np.tile(STRAIN, (operators.point_count, 1)), atol=1e-14)
    assert operators.volumetric_strain(strain) == pytest.approx(STRAIN[0] + STRAIN[1])


@each_element
@with_and_without_b_bar
def test_rigid_motion_strains_nothing(element: str, b_bar: bool) -> None:
    mesh = distorted(element)
    operators = build_operators(mesh, b_bar=b_bar)
    x, y = mesh.nodes.T
    for moved in ((1.0 + 0 * x, 0 * y), (0 * x, 1.0 + 0 * y), (-y, x)):
        assert np.abs(operators.strain @ np.concatenate(moved)).max() < 1e-13


@each_element
@with_and_without_b_bar
def test_work_of_nodal_forces_is_that_of_the_stresses(element: str, b_bar: bool) -> None:
    operators = build_operators(distorted(element), b_bar=b_bar)
    rng = np.random.default_rng(0)
    stress = rng.standard_normal((3, operators.point_count))
    du = rng.standard_normal(2 * operators.node_count)
    dstrain = (operators.strain @ du).reshape(3, -1)
    double_contraction = (stress * dstrain * [[1.0], [1.0], [2.0]]).sum(axis=0)
    work = double_contraction @ operators.volumes
    assert (operators.force @ stress.ravel()) @ du == pytest.approx(work, rel=ROUNDING)


@each_element
def test_pressure_all_round_balances_the_same_isotropic_stress(element: str) -> None:
    operators = build_operators(distorted(element))
    stress = np.repeat([1.0, 1.0, 0.0], operators.point_count)
    loads = sum(operators.pressure_force(side) for side in operators.mesh.boundary_names)
    np.testing.assert_allclose(operators.force @ stress, loads, atol=1e-14)


@each_element
def test_masses_add_up_and_none_is_negative(element: str) -> None:
    operators = build_operators(distorted(element))
    lumped = operators.lumped_mass(2650.0)
    assert (lumped > 0.0).all()
    assert lumped.sum() == pytest.approx(2 * 2650.0 * 1.5)


@each_element
def test_weight_is_that_of_the_area(element: str) -> None:
    operators = build_operators(distorted(element))
    weight = operators.body_force((0.0, -9.81)).reshape(2, -1).sum(axis=1)
    np.testing.assert_allclose(weight, [0.0, -9.81 * 1.5], atol=1e-12)


def test_traction_pulls_in_its_direction() -> None:
    operators = build_operators(rectangle(0.5, 1.0, 2, 4))
    force = operators.traction_force("top", (0.0, 2.0)).reshape(2, -1).sum(axis=1)
    np.testing.assert_allclose(force, [0.0, 2.0 * 0.5], atol=1e-14)


def test_b_bar_has_one_volumetric_strain_in_an_element() -> None:
    operators = build_operators(distorted("quad4"), b_bar=True)
    du = np.random.default_rng(3).standard_normal(2 * operators.node_count)
    strain = (operators.strain @ du).reshape(3, -1, 4)
    assert np.ptp(strain[0] + strain[1], axis=1).max() < 1e-12


@pytest.mark.parametrize(
    ("element", "order"), [("quad8", 3), ("quad4", 2), ("tri3", 2), ("tri6", 3)]
)
def test_displacements_converge_with_the_order_of_the_element(element: str, order: int) -> None:
    """Kolosov's solution 2 G (u + i v) = kappa phi - z conj(phi'), phi = exp(z), without weight."""
    kappa = (LAME + 3 * SHEAR) / (LAME + SHEAR)

    def exact(x: np.ndarray) -> np.ndarray:
        z = x[:, 0] + 1j * x[:, 1]
        return (kappa * np.exp(z) - z * np.conj(np.exp(z))) / (2 * SHEAR)

    loading = bounded_by(lambda x: exact(x).real, lambda x: exact(x).imag)
    errors = []
    for cells in (4, 8, 16):
        mesh = rectangle(1.0, 1.0, cells, cells, element)
        settings = ImplicitSettings(steps=1, tolerance=1e-12)
        found = run(Body(loading), elastic_cell(), solver=settings, mesh=mesh).check()
        u = found["displacement"].values[-1]
        basis = skfem.CellBasis(mesh.geometry, mesh.kind.shape(), intorder=6)
        places = np.asarray(basis.global_coordinates())
        truth = exact(places.reshape(2, -1).T).reshape(places.shape[1:])
        parts = [np.asarray(basis.interpolate(u[:, k])) for k in (0, 1)]
        squares = (parts[0] - truth.real) ** 2 + (parts[1] - truth.imag) ** 2
        errors.append(np.sqrt((squares * basis.dx).sum()))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    # The asymptotic order, within what is left of the next term on the coarser pair.
    assert rates[-1] == pytest.approx(order, abs=0.12)


def turned_inside_out(mesh: PlaneMesh) -> tuple[np.ndarray, np.ndarray]:
    nodes = mesh.geometry.p.T.copy()
    inner = np.flatnonzero((nodes > 1e-9).all(axis=1) & (nodes < [0.49, 0.99]).all(axis=1))[0]
    nodes[inner] += (0.4, 0.0)
    return nodes, mesh.geometry.t.T


@pytest.mark.parametrize("element", ["quad4", "tri3"])
def test_inverted_element_is_refused_by_its_number(element: str) -> None:
    nodes, corners = turned_inside_out(rectangle(0.5, 1.0, 4, 4, element))
    with pytest.raises(ConfigurationError, match=r"element \d+ "):
        PlaneMesh.of_arrays(nodes, corners, {}, element)


def test_element_without_area_is_refused() -> None:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [2.0, 0.0]])
    with pytest.raises(ConfigurationError, match="element 1 .* is inverted or flat"):
        PlaneMesh.of_arrays(nodes, np.array([[0, 1, 2], [0, 1, 4]]), {})


def test_element_with_its_corners_on_a_line_is_refused() -> None:
    corners = np.array([[0, 1, 2, 3]])
    line = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
    with pytest.raises(
        ConfigurationError, match=r"element 0 .* at \(1.5, 0\), is inverted or flat"
    ):
        PlaneMesh.of_arrays(line, corners, {})


@pytest.mark.parametrize("element", ["quad8", "tri6"])
def test_coordinate_that_is_not_finite_is_refused(element: str) -> None:
    geometry = rectangle(1.0, 1.0, 2, 2, element).geometry
    geometry.p[1, 3] = np.nan
    with pytest.raises(ConfigurationError, match="node 3 .* has a coordinate that is not finite"):
        PlaneMesh(geometry, element)


def test_clockwise_numbers_are_no_inversion() -> None:
    mesh = rectangle(0.5, 1.0, 2, 2)
    turned = PlaneMesh.of_arrays(mesh.geometry.p.T, mesh.geometry.t[::-1].T, {})
    assert build_operators(turned).volumes.sum() == pytest.approx(0.5)


@pytest.mark.parametrize("element", ["quad8", "quad4", "tri3", "tri6"])
def test_elements_turn_over_where_a_corner_passes_its_neighbours(element: str) -> None:
    mesh = rectangle(1.0, 1.0, 2, 2, element)
    moved = np.zeros_like(mesh.nodes)
    centre = mesh.node_at(0.5, 0.5)
    around = (mesh.element_nodes[:, : mesh.kind.corners] == centre).any(axis=1)
    assert not mesh.turned(moved).any()
    moved[centre] = (0.3, 0.0)
    assert not mesh.turned(moved).any()
    moved[centre] = (0.6, 0.0)  # beyond the right edge
    turned = mesh.turned(moved)
    assert turned.any() and not turned[~around].any()
    angle = 2.0  # a rotation turns nothing over, and no more does a rigid motion
    rotation = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    assert not mesh.turned(mesh.nodes @ rotation - mesh.nodes + 3.0).any()
    mirrored = -2.0 * mesh.nodes * (1.0, 0.0)
    assert mesh.turned(mirrored).all()


def test_element_that_does_not_fit_the_mesh_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="tri6.*quad8"):
        PlaneMesh(skfem.MeshQuad(), "tri6")
    with pytest.raises(ConfigurationError, match="'hexa'.*quad8"):
        PlaneMesh(skfem.MeshQuad(), "hexa")


def test_unknown_boundary_and_missing_node_are_named() -> None:
    mesh = rectangle(0.5, 1.0, 2, 4)
    with pytest.raises(ConfigurationError, match="'lid'.*left, right"):
        mesh.nodes_on("lid")
    with pytest.raises(ConfigurationError, match=r"\(0.3, 0\)"):
        mesh.node_at(0.3, 0.0)
