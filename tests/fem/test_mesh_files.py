"""Files of Gmsh and Abaqus, of whatever order, are one body, or a sentence says why not."""

import os
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from mesh_writers import (
    SIDES,
    Specimen,
    abaqus,
    gmsh_22,
    gmsh_41,
    specimen,
    turned_clockwise,
    written,
)

from granbench.errors import ConfigurationError, GranbenchError
from granbench.fem import ImplicitSettings, PlaneMesh, find_problem, run
from granbench.fem.mesh_file import read_mesh
from granbench.fem.mesh_files import read_plane_cells
from granbench.fem.operators import build_operators
from granbench.models import MODELS

BIAXIAL = find_problem("biaxial", end_strain=0.004, confinement=5e4)
TRIANGLES = (3, 6)


def reaction(mesh: PlaneMesh | str) -> np.ndarray:
    settings = ImplicitSettings(steps=2)
    return run(BIAXIAL, MODELS["j2"](), solver=settings, mesh=mesh).check()["reaction"].values


@pytest.fixture(scope="module")
def coarse() -> np.ndarray:
    return reaction("coarse")


def require_body(mesh: PlaneMesh, *, triangles: bool) -> None:
    """The specimen with its four sides, in elements with nodes on their edges."""
    assert mesh.element == ("tri6" if triangles else "quad8")
    assert mesh.area == pytest.approx(0.5)
    assert len(mesh.element_nodes) == (16 if triangles else 8)
    for name in SIDES:
        length = 0.5 if name in ("bottom", "top") else 1.0
        assert mesh.edge_length(mesh.facets_on(name)) == pytest.approx(length)


@pytest.mark.parametrize("count", [3, 4, 6, 8, 9])
@pytest.mark.parametrize("version", ["2.2", "2.2 binary", "4.1", "4.1 all", "clockwise"])
def test_gmsh_files_of_either_order_are_one_body(tmp_path: Path, count: int, version: str) -> None:
    found = specimen(count)
    content = {
        "2.2": lambda: gmsh_22(found),
        "2.2 binary": lambda: gmsh_22(found, binary=True),
        "4.1": lambda: gmsh_41(found),
        "4.1 all": lambda: gmsh_41(found, save_all=True),
        "clockwise": lambda: gmsh_41(turned_clockwise(found)),
    }[version]()
    mesh = BIAXIAL.mesh(str(written(tmp_path / "soil.msh", content)))
    require_body(mesh, triangles=count in TRIANGLES)
    assert mesh.notes == ()


@pytest.mark.parametrize(
    ("kind", "count"),
    [("CPE3", 3), ("CPE4", 4), ("CPE4R", 4), ("CPE4H", 4), ("CPE6", 6), ("CPE6M", 6), ("CPE8", 8),
     ("cpe8r", 8), ("CPS4R", 4), ("CPS8R", 8), ("CPE8RP", 8)],
)  # fmt: skip
@pytest.mark.parametrize("boundaries", ["nset", "surface", "elset"])
def test_abaqus_files_are_one_body(tmp_path: Path, kind: str, count: int, boundaries: str) -> None:
    file = written(tmp_path / "soil.inp", abaqus(specimen(count), kind, boundaries=boundaries))
    mesh = BIAXIAL.mesh(str(file))
    require_body(mesh, triangles=count in TRIANGLES)
    assert any("plane stress" in note for note in mesh.notes) == kind.startswith("CPS")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.msh", gmsh_41(specimen(4))),
        ("a.msh", gmsh_22(specimen(9), binary=True)),
        ("a.inp", abaqus(specimen(8), "CPE8R")),
        ("a.inp", abaqus(specimen(4), "CPE4", boundaries="surface")),
    ],
)
def test_analysis_of_a_file_is_that_of_the_same_mesh_made_here(
    tmp_path: Path, coarse: np.ndarray, name: str, content: bytes | str
) -> None:
    file = written(tmp_path / name, content)
    np.testing.assert_allclose(reaction(str(file)), coarse, rtol=1e-9)


def test_boundaries_without_names_are_found_by_their_place(
    tmp_path: Path, coarse: np.ndarray
) -> None:
    found = specimen(8)
    files = [written(tmp_path / "soil.msh", gmsh_22(found, groups=False))]
    for suffix in (".vtk", ".vtu"):
        files.append(tmp_path / f"soil{suffix}")
        meshio.Mesh(found.nodes, [("quad8", found.elements)]).write(files[-1])
    other = replace(found, sides={f"Line {n}": rows for n, rows in enumerate(found.sides.values())})
    files.append(written(tmp_path / "other.msh", gmsh_41(other)))
    for file in files:
        mesh = BIAXIAL.mesh(str(file))
        require_body(mesh, triangles=False)
        assert any("found by their place" in note for note in mesh.notes)
        np.testing.assert_allclose(reaction(mesh), coarse, rtol=1e-9)


def test_names_are_compared_without_regard_to_case(tmp_path: Path) -> None:
    text = abaqus(specimen(4), "CPE4").replace("nset=top", "nset=TOP").replace("=left", '="Left"')
    mesh = BIAXIAL.mesh(str(written(tmp_path / "soil.inp", text)))
    require_body(mesh, triangles=False)


def test_elements_of_several_groups_count_once(tmp_path: Path) -> None:
    found = specimen(4)
    twice = replace(found, elements=np.concatenate([found.elements, found.elements[:3]]))
    require_body(read_mesh(written(tmp_path / "a.msh", gmsh_22(twice))), triangles=False)


def test_nodes_at_one_place_are_merged_with_a_note(tmp_path: Path, coarse: np.ndarray) -> None:
    found = specimen(4)
    nodes, elements = np.concatenate([found.nodes, found.nodes]), found.elements.copy()
    elements[4:] += len(found.nodes)  # the upper half on nodes of its own
    sides = {**found.sides, "top": found.sides["top"] + len(found.nodes)}
    file = written(tmp_path / "soil.msh", gmsh_22(Specimen(nodes, elements, sides)))
    mesh = BIAXIAL.mesh(str(file))
    assert any("taken for one" in note for note in mesh.notes)
    np.testing.assert_allclose(reaction(mesh), coarse, rtol=1e-9)


def test_triangles_with_quadrilaterals_give_triangles_with_a_note(tmp_path: Path) -> None:
    found = specimen(4)
    text = abaqus(replace(found, elements=found.elements[2:]), "CPE4R")
    a, b, c, d = found.elements[:2].T + 1
    rows = [f"{50 + i}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(
        [*zip(a, b, c, strict=True), *zip(a, c, d, strict=True)])]  # fmt: skip
    corners = [f"{n + 1}, {found.nodes[n, 0]}, {found.nodes[n, 1]}"
               for n in np.unique(found.elements[:2])]  # fmt: skip
    more = "\n".join(["*Node", *corners, "*Element, type=CPE3", *rows, "*End Part"])
    text = text.replace("*End Part", more, 1)
    text = text.replace("nset=bottom, instance=Soil-1\n", "nset=bottom, instance=Soil-1\n1, 3, 5\n")
    for name, lines in found.sides.items():
        text += f"*Nset, nset={name}, instance=Soil-1\n"
        text += "".join(f"{n + 1}\n" for n in np.unique(lines))
    mesh = BIAXIAL.mesh(str(written(tmp_path / "soil.inp", text)))
    require_body(mesh, triangles=True)
    assert any("cut into two triangles" in note for note in mesh.notes)


@pytest.mark.parametrize("count", [6, 8, 9])
def test_curved_edges_are_kept_and_linear_displacements_are_exact(
    tmp_path: Path, count: int
) -> None:
    """A ring's quarter: its area is exact to the fourth order, and strain B u of u = G x is G."""
    found = specimen(count)
    radius, angle = 1.0 + found.nodes[:, 0], 0.5 * np.pi * found.nodes[:, 1]
    nodes = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle], axis=1)
    mesh = read_mesh(written(tmp_path / "a.msh", gmsh_41(replace(found, nodes=nodes))))
    exact = 0.25 * np.pi * (1.5**2 - 1.0)
    assert mesh.area == pytest.approx(exact, rel=1e-3)
    straight = 0.5 * 4 * np.sin(np.pi / 8) * (1.5**2 - 1.0)
    assert abs(mesh.area - exact) < 0.05 * abs(straight - exact)
    operators = build_operators(mesh)
    gradient = np.array([[0.1, 0.02], [0.03, -0.2]])
    strain = operators.strain @ (mesh.nodes @ gradient.T).T.ravel()
    expected = -np.array([0.1, -0.2, 0.025])[:, None]
    np.testing.assert_allclose(strain.reshape(3, -1) - expected, 0.0, atol=1e-12)


def lifted(found: Specimen) -> Specimen:
    return replace(found, nodes=found.nodes[:, [0, 2, 1]])


def gap(found: Specimen) -> Specimen:
    return replace(found, sides={**found.sides, "left": found.sides["left"][[0, 1, 3]]})


def hole(found: Specimen) -> Specimen:
    return replace(found, elements=np.delete(found.elements, 3, axis=0))


def slit(found: Specimen) -> Specimen:
    """Elements 2 and 4 share no nodes at their common edge, whose middle is moved apart a bit."""
    nodes = np.concatenate([found.nodes, found.nodes + np.array([0.0, 1e-4, 0.0])])
    elements = found.elements.copy()
    elements[4] = [e + len(found.nodes) if e in found.elements[2] else e for e in elements[4]]
    return replace(found, nodes=nodes, elements=elements)


def loose(found: Specimen) -> Specimen:
    nodes = np.concatenate([found.nodes, found.nodes + np.array([3.0, 0.0, 0.0])])
    more = found.elements[:1] + len(found.nodes)
    return replace(found, nodes=nodes, elements=np.concatenate([found.elements, more]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lifted, "z goes from 0 to 1"),
        (gap, "boundary 'left'"),
        (hole, "area of|an outline"),
        (slit, "outline"),
        (loose, "2 parts that share no nodes"),
    ],
)
def test_what_is_no_body_of_the_problem_is_refused(tmp_path: Path, change, words: str) -> None:
    file = written(tmp_path / "soil.msh", gmsh_41(change(specimen(4))))
    with pytest.raises(ConfigurationError, match=rf"(?s)soil\.msh.*({words})"):
        BIAXIAL.mesh(str(file))


@pytest.mark.parametrize(
    ("kind", "words"),
    [("C3D8", "C3D8 is three-dimensional"), ("CAX4", "CAX4 is axisymmetric"),
     ("DC2D4", "DC2D4 is not known.*use CPE3, CPE4")],
)  # fmt: skip
def test_element_that_is_not_read_is_named_with_its_line(
    tmp_path: Path, kind: str, words: str
) -> None:
    file = written(tmp_path / "soil.inp", abaqus(specimen(4), kind))
    with pytest.raises(ConfigurationError, match=rf"soil\.inp: line \d+: element {words}"):
        read_mesh(file)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("*INCLUDE, INPUT={}", "INCLUDE reads .*not opened"),
        ("*include,input={}", "INCLUDE reads .*not opened"),
        ("*Node, input={}", "NODE reads .*not opened"),
        ("*Element, type=CPE4,\n input={}", "ELEMENT reads .*not opened"),
        ("*NGEN, nset={}", "NGEN makes or moves nodes"),
        ("*Node, system=C, nset={}", "NODE, system makes or moves nodes"),
    ],
)
def test_files_that_a_mesh_names_are_not_opened(tmp_path: Path, line: str, words: str) -> None:
    os.mkfifo(tmp_path / "pipe.inp")
    (tmp_path / "zero.inp").symlink_to("/dev/zero")
    for name in ("pipe.inp", "zero.inp", "none.inp"):
        file = written(tmp_path / "soil.inp", line.format(tmp_path / name) + "\n")
        with pytest.raises(ConfigurationError, match=rf"soil\.inp: line 1: \*{words}"):
            read_mesh(file)


@pytest.mark.parametrize("suffix", [".msh", ".inp", ".vtk", ".vtu", ".mesh"])
def test_pipes_devices_and_folders_are_no_meshes(tmp_path: Path, suffix: str) -> None:
    os.mkfifo(tmp_path / f"pipe{suffix}")
    (tmp_path / f"zero{suffix}").symlink_to("/dev/zero")
    (tmp_path / f"folder{suffix}").mkdir()
    for name in ("pipe", "zero", "folder"):
        with pytest.raises(ConfigurationError, match="is not a regular file"):
            read_mesh(tmp_path / f"{name}{suffix}")


@pytest.mark.parametrize("name", ["soil.xdmf", "soil.med", "soil.unv", "folder/soil"])
def test_other_formats_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"{name}.*\.msh, \.inp"):
        find_problem("biaxial").mesh(str(tmp_path / name))


def test_declared_sizes_are_refused_before_anything_is_read(tmp_path: Path) -> None:
    content = gmsh_41(specimen(4)).replace(b"1 45 1 45", b"1 4000000000 1 45")
    with pytest.raises(ConfigurationError, match="4,000,000,000 nodes"):
        read_mesh(written(tmp_path / "a.msh", content))


def mutated(content: bytes, random: np.random.Generator) -> bytes:
    """Bytes exchanged, a piece cut out or doubled, a number replaced, or the end cut off."""
    kind = random.integers(5)
    a, b = sorted(random.integers(0, len(content), 2))
    if kind == 0:
        changed = bytearray(content)
        for place in random.integers(0, len(content), 3):
            changed[place] = random.integers(256)
        return bytes(changed)
    if kind == 1:
        return content[:b]
    if kind == 2:
        return content[:a] + content[min(b, a + 60) :]
    if kind == 3:
        return content[:b] + content[a : min(b, a + 200)] + content[b:]
    words = content.split(b" ")
    odd = [b"-1", b"1e308", b"nan", b"99999999999999999999", b"0", b"", b"4294967295", b"$End"]
    words[random.integers(len(words))] = odd[random.integers(len(odd))]
    return b" ".join(words)


@pytest.mark.parametrize("kind", ["2.2", "2.2 binary", "4.1", "inp"])
def test_damaged_files_are_refused_or_read(tmp_path: Path, kind: str) -> None:
    """In this process: what it raises is what the reading process would have to guess about."""
    content = {
        "2.2": lambda: gmsh_22(specimen(6)),
        "2.2 binary": lambda: gmsh_22(specimen(8), binary=True),
        "4.1": lambda: gmsh_41(specimen(9), save_all=True),
        "inp": lambda: abaqus(specimen(8), "CPE8R", boundaries="surface").encode(),
    }[kind]()
    random = np.random.default_rng(12)
    file = tmp_path / f"a.{'inp' if kind == 'inp' else 'msh'}"
    for _ in range(150):
        file.write_bytes(mutated(content, random))
        try:
            read_plane_cells(str(file))
        except GranbenchError as refusal:
            assert str(file) in str(refusal)
