"""The periodic box, compared with closed forms of lattices: stress, bulk and shear stiffness."""

import itertools
import math

import numpy as np
import pytest
from one_engine import isolated

from granbench.errors import EngineError
from granbench.generators.dem.box import GrainBox
from granbench.generators.dem.material import ContactMaterial
from granbench.generators.dem.measurement import contact_stress, contacts
from granbench.generators.dem.packing import face_centred_cubic, place_grains, simple_cubic

DIAMETER = 0.0118
STICKY = ContactMaterial(friction=10.0, rolling_friction=0.0)
LATTICES = {simple_cubic: 6, face_centred_cubic: 12}


def lattice_box(folder, lattice, cells, friction=STICKY.friction):
    positions, edges = lattice(cells, DIAMETER)
    box = GrainBox.from_packing(
        folder / "lattice.log", folder / "lattice.data", positions,
        np.full(len(positions), DIAMETER), float(edges[0]), STICKY, friction,
    )  # fmt: skip
    box.sample_every(1)
    return box


def compress(box, volumetric_strain, chunks=10, steps=20):
    for _ in range(chunks):
        box.strain(np.full(3, volumetric_strain / 3 / chunks), steps)
    box.strain(np.zeros(3), 400)  # the grains oscillate for a while after the stop
    return box.strain(np.zeros(3), 50)


def hertz_force(overlap):
    modulus = STICKY.young_modulus / (2 * (1 - STICKY.poisson_ratio**2))
    return 4 / 3 * modulus * math.sqrt(DIAMETER / 4) * overlap**1.5


def compressed_lattice(folder, lattice, strains):
    # With friction, the stop would leave an error of 1e-5 of the stress.
    box = lattice_box(folder, lattice, 4, friction=0.0)
    done, states = 0.0, []
    for strain in strains:
        stress = compress(box, strain - done)
        done = strain
        found = contacts(box)
        states.append((stress, box.volume, found.coordination_number, found.fabric))
    return box.grain_count, states


@pytest.mark.parametrize("lattice", LATTICES)
def test_stress_of_a_compressed_lattice_is_its_closed_form(tmp_path, lattice):
    neighbours = LATTICES[lattice]
    strains = (3e-4, 1.2e-3, 1.206e-3)
    count, states = isolated(compressed_lattice, tmp_path, lattice, strains)
    pressures = []
    for strain, (stress, volume, coordination, fabric) in zip(strains, states, strict=True):
        overlap = DIAMETER * -math.expm1(-strain / 3)
        force, branch = hertz_force(overlap), DIAMETER - overlap
        pressure = neighbours * count * force * branch / (6 * volume)
        # The relative rounding error of an overlap of 1e-4 d is about 1e-11.
        np.testing.assert_allclose(stress[:3], pressure, rtol=1e-6)
        np.testing.assert_allclose(stress[3:], 0.0, atol=1e-6 * pressure)
        assert coordination == neighbours
        np.testing.assert_allclose(fabric, [1 / 3, 1 / 3, 1 / 3, 0, 0, 0], atol=1e-9)
        # p = z phi_s F / (4 pi R^2) holds to the first order of the strain
        solid = count * math.pi / 6 * DIAMETER**3 / volume
        assert pressure == pytest.approx(
            neighbours * solid * force / (math.pi * DIAMETER**2), rel=strain
        )
        pressures.append(stress[:3].mean())
    # K = 1.5 p / eps_v, to the first order of the strain, from the secant of the last two.
    secant = (pressures[2] - pressures[1]) / (strains[2] - strains[1])
    middle = 1.5 * (pressures[1] + pressures[2]) / (strains[1] + strains[2])
    assert secant == pytest.approx(middle, rel=2e-3)


def sheared_lattice(folder):
    """Change of stress, and volume, of an FCC lattice under an isochoric affine strain."""
    box = lattice_box(folder, face_centred_cubic, 3)
    before = compress(box, VOLUMETRIC)
    for _ in range(40):
        box.strain(SHEAR / 40, 10)
    after = box.strain(np.zeros(3), 100)
    return after - before, box.volume, box.grain_count


VOLUMETRIC, SHEAR = 1.2e-3, 1e-5 * np.array([1.0, -0.5, -0.5])


def test_affine_shear_loads_the_tangential_springs(tmp_path):
    """With `remap x` LIGGGHTS would move grains without sliding, so that springs would not act."""
    change, volume, count = isolated(sheared_lattice, tmp_path)
    overlap = DIAMETER * -math.expm1(-VOLUMETRIC / 3)
    branch, force = DIAMETER - overlap, hertz_force(overlap)
    normal = 1.5 * force / overlap
    tangential = normal * 2 * (1 - STICKY.poisson_ratio) / (2 - STICKY.poisson_ratio)

    def deviator(tangential_stiffness):
        """Sum over one contact of a grain in each of the six directions."""
        stress = np.zeros((3, 3))
        for a, b in itertools.combinations(np.eye(3), 2):
            for n in (a + b, a - b):
                n = n / math.sqrt(2)
                motion = branch * SHEAR * n
                approach = (motion @ n) * n
                push = normal * approach + tangential_stiffness * (motion - approach)
                # The branches change under the force that is already there.
                turned = -force * motion
                stress += np.outer(push, n * branch) + np.outer(turned, n)
        stress *= count / volume
        return stress[0, 0] - 0.5 * (stress[1, 1] + stress[2, 2])

    measured = change[0] - 0.5 * (change[1] + change[2])
    assert measured == pytest.approx(deviator(tangential), rel=5e-3)
    # The values in docs/dem.md, with the springs and without.
    assert measured == pytest.approx(328.0, rel=5e-3)
    assert deviator(0.0) == pytest.approx(86.0, rel=5e-3)


def loose_box(folder, count=200):
    positions, edge = place_grains(np.full(count, DIAMETER), 0.3, np.random.default_rng(0))
    return GrainBox.from_packing(
        folder / "loose.log", folder / "loose.data", positions, np.full(count, DIAMETER), edge,
        ContactMaterial(), 0.4,
    )  # fmt: skip


def sheared_packing(folder):
    box = loose_box(folder)
    while box.strain(np.full(3, 2e-3), 20)[:3].mean() < 2e5:
        pass
    for _ in range(10):
        box.strain(np.array([1e-3, -4e-4, -4e-4]), 40)
    box.sample_every(1)
    for _ in range(10):
        box.stop_grains()
        box.strain(np.zeros(3), 40)
    return box.strain(np.zeros(3), 1), contact_stress(box), box.strain(np.zeros(3), 1)


def test_virial_is_the_sum_over_contacts_of_force_and_branch(tmp_path):
    virial, summed, later = isolated(sheared_packing, tmp_path)
    assert virial[:3].min() > 1e4 and np.ptp(virial[:3]) > 1e4
    # One has the damping of the half step, the other of the full step; at rest both are small.
    np.testing.assert_allclose(summed, virial, atol=1e-3 * virial[:3].mean())
    # Reading the forces does not change the simulation.
    np.testing.assert_allclose(later, virial, atol=1e-3 * virial[:3].mean())


def chunks_of(folder, steps):
    """Mean stress of every chunk, and the stress in LIGGGHTS at its last step."""
    box = lattice_box(folder, simple_cubic, 3)
    compress(box, 3e-4)
    chunks, ends = [], []
    for _ in range(10 // steps):
        chunks.append(box.strain(np.full(3, steps * 1e-6), steps)[:3].mean())
        ends.append(box.engine.compute_scalar("virial"))
    return np.array(chunks), np.array(ends)


def test_stress_of_a_chunk_is_the_mean_of_its_steps(tmp_path):
    singles, ends = isolated(chunks_of, tmp_path, 1)
    # The average is over all steps since the start, from which the last few are separated.
    np.testing.assert_allclose(singles, ends, rtol=1e-9)
    assert np.ptp(ends) > 0.01 * ends.mean()
    (whole,), _ = isolated(chunks_of, tmp_path, 10)
    # One logarithmic increment or ten, each with constant speed, differ in the second order.
    assert whole == pytest.approx(ends.mean(), rel=1e-4)


def box_that_loses_a_grain(folder):
    box = loose_box(folder)
    box.strain(np.zeros(3), 10)
    box.engine.command(f"group last id {box.grain_count}", "delete_atoms group last")
    box.strain(np.zeros(3), 10)


def test_lost_grain_is_an_error(tmp_path):
    with pytest.raises(EngineError, match="1 of 200 grains"):
        isolated(box_that_loses_a_grain, tmp_path)


def crushed_box(folder):
    box = lattice_box(folder, simple_cubic, 3)
    for _ in range(100):
        box.strain(np.full(3, 1e-2), 20)


def test_impossibly_small_void_ratio_is_an_error(tmp_path):
    with pytest.raises(EngineError, match="void ratio"):
        isolated(crushed_box, tmp_path)


def strained_edges(folder):
    box = loose_box(folder)
    start = box.lengths
    for steps in (10, 30):
        box.strain(np.array([0.01, -0.02, 0.005]), steps)
    return -np.log(box.lengths / start), box.lengths, box.engine.box_lengths()


def test_box_follows_the_prescribed_logarithmic_strain(tmp_path):
    strain, lengths, engine_lengths = isolated(strained_edges, tmp_path)
    np.testing.assert_allclose(strain, [0.02, -0.04, 0.01], rtol=1e-12)
    # The edges in LIGGGHTS are one step ahead of the grains.
    np.testing.assert_allclose(engine_lengths, lengths, rtol=1e-3)


def two_engines(folder):
    loose_box(folder).close()
    loose_box(folder)


def test_second_engine_in_a_process_is_refused(tmp_path):
    with pytest.raises(EngineError, match="only once"):
        isolated(two_engines, tmp_path)
