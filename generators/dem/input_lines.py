"""LIGGGHTS input lines for grains in a periodic box: styles, material, contacts, packings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from granbench.generators.dem.material import ContactMaterial

CONTACT_MODEL = "model hertz tangential history rolling_friction epsd2"

STYLES = (
    "units si",
    "atom_style sphere",
    "atom_modify map array sort 0 0",
    "boundary p p p",
    "newton off",
    "communicate single vel yes",
)


def pair_property(name: str, figure: float) -> str:
    """The line that sets a property of all contacts.

    Parameters
    ----------
    name : of the property in LIGGGHTS
    figure : its value, SI
    """
    return f"fix {name} all property/global {name} peratomtypepair 1 {figure:.17g}"


def contact_lines(
    material: ContactMaterial, friction: float, skin: float, time_step: float
) -> tuple[str, ...]:
    """The lines that define material, contacts, integration and measurements.

    Parameters
    ----------
    material : contact material; its friction is not used
    friction : sliding friction of all contacts
    skin : of the neighbour lists, m
    time_step : s
    """
    return (
        f"neighbor {skin:.17g} bin",
        "neigh_modify delay 0",
        f"fix modulus all property/global youngsModulus peratomtype {material.young_modulus}",
        f"fix poisson all property/global poissonsRatio peratomtype {material.poisson_ratio}",
        pair_property("coefficientRestitution", material.restitution),
        pair_property("coefficientFriction", friction),
        pair_property("coefficientRollingFriction", material.rolling_friction),
        f"pair_style gran {CONTACT_MODEL}",
        "pair_coeff * *",
        f"timestep {time_step:.17g}",
        "fix integrate all nve/sphere",
        "thermo_style custom step atoms",
        "thermo 1000000000",
        # Of the contact forces only, and without the sum over grains that stress/atom needs.
        "compute virial all pressure thermo_temp virial",
        # LIGGGHTS accepts one such compute only, and none after the first run.
        "compute contacts all pair/gran/local id force contactArea",
        "compute contact_area all reduce sum c_contacts[7]",
        "compute contact_mean all reduce ave c_contacts[7]",
    )


def write_packing(
    path: Path, positions: np.ndarray, diameters: np.ndarray, box_edge: float, density: float
) -> None:
    """Write a data file of grains at rest, which `read_data` reads.

    Parameters
    ----------
    path : of the file
    positions : (grain, 3), m
    diameters : (grain,), m
    box_edge : of the cube, m
    density : of the grains, kg/m3
    """
    edges = "\n".join(f"0 {box_edge:.17g} {axis}lo {axis}hi" for axis in "xyz")
    grains = "\n".join(
        f"{i} 1 {d:.17g} {density:.17g} {x:.17g} {y:.17g} {z:.17g}"
        for i, (d, (x, y, z)) in enumerate(zip(diameters, positions, strict=True), start=1)
    )
    Path(path).write_text(
        f"grains\n\n{diameters.size} atoms\n1 atom types\n{edges}\n\nAtoms\n\n{grains}\n"
    )
