"""The contact law, compared with the collisions of Chung and Ooi (2011), Hertz and Coulomb."""

import math

import numpy as np
import pytest
from one_engine import isolated

from granbench.errors import ConfigurationError
from granbench.generators.dem.collision import collide, hertz_contact_time
from granbench.generators.dem.material import ContactMaterial

GLASS = ContactMaterial(
    density=2800.0, young_modulus=48e9, poisson_ratio=0.20, friction=0.35,
    rolling_friction=0.0, restitution=1.0,
)  # fmt: skip
ALUMINA = ContactMaterial(
    density=4000.0, young_modulus=380e9, poisson_ratio=0.23, friction=0.092,
    rolling_friction=0.0, restitution=0.98,
)  # fmt: skip
SPEED, RADIUS = 3.9, 2.5e-3
SLIDING_ANGLES = (45, 60, 75)
"""Angles from the normal, degrees; a rigid sphere always slides above atan(7/2 mu (1 + e)) = 33."""


def on_the_plane(folder, degrees):
    return isolated(
        collide, folder / f"{degrees}.log", ALUMINA, RADIUS, SPEED,
        angle=math.radians(degrees), plane_stiffness=1000.0,
    )  # fmt: skip


def test_equal_glass_spheres_collide_as_in_chung_and_ooi_test_1(tmp_path):
    collision = isolated(collide, tmp_path / "test1.log", GLASS, 0.01, 10.0)
    # Half a unit of the last printed digit; the contact time is also resolved to 1/800 only.
    assert collision.normal_force.max() == pytest.approx(10.70e3, abs=5.0)
    assert collision.overlap.max() == pytest.approx(274.1e-6, abs=0.05e-6)
    assert collision.contact_time == pytest.approx(40.4e-6, abs=0.1e-6)
    np.testing.assert_allclose(collision.velocity, [0.0, 0.0, 10.0], atol=1e-3)


def test_normal_force_follows_hertz_at_every_overlap(tmp_path):
    collision = isolated(collide, tmp_path / "hertz.log", GLASS, 0.01, 10.0)
    modulus = GLASS.young_modulus / (2 * (1 - GLASS.poisson_ratio**2))
    force = 4 / 3 * modulus * math.sqrt(0.005) * collision.overlap**1.5
    # Only rounding, because positions and forces are those of one instant.
    np.testing.assert_allclose(collision.normal_force, force, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("degrees", SLIDING_ANGLES)
def test_oblique_impact_slides_as_in_chung_and_ooi_test_4(tmp_path, degrees):
    collision = on_the_plane(tmp_path, degrees)
    angle = math.radians(degrees)
    normal, tangential = SPEED * math.cos(angle), SPEED * math.sin(angle)
    mu, restitution = ALUMINA.friction, ALUMINA.restitution
    assert collision.velocity[2] / normal == pytest.approx(restitution, abs=2e-3)
    rebound = 1 - mu * (1 + restitution) / math.tan(angle)
    # Within one percent: friction reverses for a moment while the contact unloads.
    assert collision.velocity[0] / tangential == pytest.approx(rebound, rel=2e-3)
    spin = 5 / 2 * mu * (1 + restitution) * normal / RADIUS
    assert abs(collision.spin[1]) == pytest.approx(spin, rel=0.01)
    assert collision.impulse_ratio == pytest.approx(mu, rel=0.01)
    direction = math.atan2(collision.velocity[0], collision.velocity[2])
    assert direction == pytest.approx(math.atan(rebound / restitution * math.tan(angle)), abs=2e-3)


@pytest.mark.parametrize("degrees", [5, 20])
def test_steep_impact_sticks_and_keeps_the_angular_momentum_about_the_contact(tmp_path, degrees):
    collision = on_the_plane(tmp_path, degrees)
    assert collision.impulse_ratio < 0.95 * ALUMINA.friction
    lost = SPEED * math.sin(math.radians(degrees)) - collision.velocity[0]
    # 2/5 m r^2 w = m r dv for any tangential force; its arm is shorter by the overlap.
    shorter = collision.overlap.max() / RADIUS
    assert abs(collision.spin[1]) * RADIUS == pytest.approx(5 / 2 * lost, rel=shorter)
    energy = np.sum(collision.velocity**2) + 2 / 5 * (RADIUS * collision.spin[1]) ** 2
    assert energy < SPEED**2


def test_normal_impact_on_the_plane_has_the_duration_of_hertz(tmp_path):
    collision = on_the_plane(tmp_path, 0)
    mass = ALUMINA.density * 4 / 3 * math.pi * RADIUS**3
    modulus = ALUMINA.young_modulus / (1 - ALUMINA.poisson_ratio**2) / 1.001
    # The damping of restitution 0.98 makes it longer by less than one percent.
    expected = hertz_contact_time(mass, RADIUS, modulus, SPEED)
    assert collision.contact_time == pytest.approx(expected, rel=0.01)
    np.testing.assert_allclose([collision.velocity[0], *collision.spin], 0.0, atol=1e-9)


@pytest.mark.parametrize("wrong", [{"radius": 0.0}, {"speed": -1.0}, {"angle": math.pi / 2}])
def test_grain_that_does_not_approach_is_refused(tmp_path, wrong):
    with pytest.raises(ConfigurationError, match=next(iter(wrong))):
        collide(tmp_path / "no.log", GLASS, **({"radius": 0.01, "speed": 1.0} | wrong))
