"""Payload shapes against DNV-RP-N103 tables, limits and symmetries; explicit keys first."""

import itertools
from math import exp, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rope_twin.errors import SceneError
from rope_twin.scene.schema import Payload
from rope_twin.scene.shapes import (
    SHAPES,
    Box,
    Cylinder,
    Skip,
    Sphere,
    SuctionAnchor,
    Template,
    depth_factor,
    payload_figures,
    perforation_factor,
)

sizes = st.floats(0.05, 50.0)


@pytest.mark.parametrize(
    ("ratio", "coefficient"), [(1.0, 0.579), (2.0, 0.757), (4.0, 0.872), (10.0, 0.947)]
)
def test_a_thin_box_is_the_tabulated_plate(ratio: float, coefficient: float) -> None:
    box = Box(length_m=2.0 * ratio, width_m=2.0, height_m=0.01)
    plate = coefficient * 0.25 * pi * 2.0**2 * (2.0 * ratio)
    assert box.added_mass_m3()[2] == pytest.approx(plate, rel=0.07)
    assert box.added_mass_m3()[2] > plate  # the thickness adds a little


@pytest.mark.parametrize(
    ("height_over_side", "coefficient"), [(1.0, 0.68), (2.0, 0.36), (3.0, 0.24), (4.0, 0.19)]
)
def test_an_upright_square_prism_is_within_10_percent_of_the_table(
    height_over_side: float, coefficient: float
) -> None:
    """Table A-2 has square prisms of its own; the plate with its depth factor comes within 10 %."""
    box = Box(length_m=1.5, width_m=1.5, height_m=1.5 * height_over_side)
    assert box.added_mass_m3()[2] / box.volume_m3() == pytest.approx(coefficient, rel=0.1)


def test_box_coefficients_follow_its_axes() -> None:
    x, y, z = Box(length_m=4.0, width_m=3.0, height_m=2.0).added_mass_m3()
    turned = Box(length_m=2.0, width_m=4.0, height_m=3.0)
    assert turned.added_mass_m3() == pytest.approx((z, x, y))
    drag = Box(length_m=4.0, width_m=3.0, height_m=2.0).drag_area_m2()
    assert turned.drag_area_m2() == pytest.approx((drag[2], drag[0], drag[1]))
    assert z > y > x  # the largest face carries the most water


def test_box_drag_by_face() -> None:
    plate = Box(length_m=10.0, width_m=10.0, height_m=0.1)
    assert plate.drag_area_m2()[2] == pytest.approx(1.16 * 100.0)
    for longer, coefficient in ((10.0, 1.50), (20.0, 1.70), (200.0, 1.88)):  # 1.90 if infinite
        strip = Box(length_m=0.4 * longer, width_m=0.4, height_m=0.1)
        assert strip.drag_area_m2()[2] == pytest.approx(coefficient * 0.16 * longer)
    rod = Box(length_m=1.0, width_m=1.0, height_m=3.0)
    assert rod.drag_area_m2()[2] == pytest.approx(0.93)
    assert rod.drag_area_m2()[0] == pytest.approx(3.0 * 1.18)  # face 3:1, between 1.16 and 1.20


def test_sphere_coefficients() -> None:
    sphere = Sphere(diameter_m=2.0)
    assert sphere.volume_m3() == pytest.approx(4.0 / 3.0 * pi)
    assert sphere.added_mass_m3() == pytest.approx((2.0 / 3.0 * pi,) * 3)
    assert sphere.drag_area_m2() == pytest.approx((0.5 * pi,) * 3)


def test_cross_flow_added_mass_of_a_long_cylinder() -> None:
    cylinder = Cylinder(diameter_m=0.5, height_m=200.0)
    assert cylinder.added_mass_m3()[0] == pytest.approx(cylinder.volume_m3(), rel=0.01)
    assert cylinder.drag_area_m2()[0] == pytest.approx(1.2 * 0.98 * 100.0)


def test_cylinder_across_by_the_table() -> None:
    cylinder = Cylinder(diameter_m=2.0, height_m=5.0)
    assert cylinder.added_mass_m3()[0] == pytest.approx(0.78 * cylinder.volume_m3())
    assert cylinder.added_mass_m3()[0] == cylinder.added_mass_m3()[1]


def test_a_flat_cylinder_is_a_disc() -> None:
    disc = Cylinder(diameter_m=4.0, height_m=0.01)
    assert disc.added_mass_m3()[2] == pytest.approx(8.0 / 3.0 * 8.0, rel=0.06)
    assert disc.drag_area_m2()[2] == pytest.approx(1.12 * 4.0 * pi, rel=1e-3)
    assert disc.added_mass_m3()[0] < 0.01 * disc.volume_m3()


def test_depth_factor_runs_from_plate_to_deep_body() -> None:
    assert depth_factor(4.0, 0.0) == 1.0
    assert depth_factor(4.0, 1e9) == pytest.approx(1.0 + 0.5**0.5)


@given(x=sizes, y=sizes, z=sizes)
def test_bodies_are_positive_and_scale_with_the_cube(x: float, y: float, z: float) -> None:
    for small, large in (
        (
            Box(length_m=x, width_m=y, height_m=z),
            Box(length_m=2 * x, width_m=2 * y, height_m=2 * z),
        ),
        (Cylinder(diameter_m=x, height_m=z), Cylinder(diameter_m=2 * x, height_m=2 * z)),
        (Sphere(diameter_m=x), Sphere(diameter_m=2 * x)),
    ):
        assert min(small.added_mass_m3()) > 0.0
        assert min(small.drag_area_m2()) > 0.0
        assert large.volume_m3() == pytest.approx(8.0 * small.volume_m3())
        assert large.added_mass_m3() == pytest.approx([8.0 * a for a in small.added_mass_m3()])
        assert large.drag_area_m2() == pytest.approx([4.0 * a for a in small.drag_area_m2()])


def test_payload_coefficients_come_from_the_shape() -> None:
    payload = Payload(name="p", mass_kg=5000.0, shape=Sphere(diameter_m=1.0))
    figures = payload_figures(payload, 1000.0)
    assert figures.mass_kg == 5000.0
    assert figures.volume_m3 == pytest.approx(pi / 6.0)
    assert figures.added_mass_kg == pytest.approx((1000.0 * pi / 12.0,) * 3)


def test_explicit_keys_override_the_shape() -> None:
    payload = Payload(
        name="p",
        mass_kg=5000.0,
        shape=Sphere(diameter_m=1.0),
        displaced_volume_m3=0.1,
        added_mass_kg=(1.0, 2.0, 3.0),
    )
    figures = payload_figures(payload, 1000.0)
    assert (figures.volume_m3, figures.added_mass_kg) == (0.1, (1.0, 2.0, 3.0))
    assert figures.drag_area_m2 == Sphere(diameter_m=1.0).drag_area_m2()


def test_all_keys_need_no_shape_but_some_do() -> None:
    whole = Payload(
        name="p",
        mass_kg=1.0,
        displaced_volume_m3=0.0,
        added_mass_kg=(0.0, 0.0, 0.0),
        drag_area_m2=(0.0, 0.0, 0.0),
    )
    assert payload_figures(whole, 1025.0).volume_m3 == 0.0
    with pytest.raises(SceneError, match="payload 'q': without a shape"):
        payload_figures(Payload(name="q", mass_kg=1.0, displaced_volume_m3=0.0), 1025.0)


def test_perforation_factor_is_continuous_and_falls() -> None:
    """DNV-RP-N103's three pieces: 1 up to 5 %, continuous at 34 % within its rounding, falling."""
    assert perforation_factor(0.0) == perforation_factor(5.0) == 1.0
    assert perforation_factor(34.0) == pytest.approx(perforation_factor(33.999), abs=0.02)
    values = [perforation_factor(p) for p in range(5, 51)]
    assert all(b < a for a, b in itertools.pairwise(values))
    assert values[-1] == pytest.approx(exp(-40.0 / 28.0))


def test_a_suction_anchor_contains_its_water() -> None:
    """5 m by 10 m in 30 mm: 5 m³ of steel, 190 m³ of water, which hatches let pass."""
    can = SuctionAnchor(diameter_m=5.0, height_m=10.0, wall_m=0.03)
    steel = pi * 4.97 * 0.03 * 9.97 + 0.25 * pi * 25.0 * 0.03
    assert can.volume_m3() == pytest.approx(steel, rel=1e-9)
    whole = Cylinder(diameter_m=5.0, height_m=10.0)
    for own, closed in zip(can.added_mass_m3(), whole.added_mass_m3(), strict=True):
        assert own == pytest.approx(closed + can.inside_m3())
    hatched = SuctionAnchor(diameter_m=5.0, height_m=10.0, wall_m=0.03, hatch_percent=20.0)
    assert hatched.added_mass_m3()[2] < 0.95 * can.added_mass_m3()[2]
    assert hatched.added_mass_m3()[0] == can.added_mass_m3()[0]


def test_a_skip_with_a_fairing_has_two_coefficients() -> None:
    """The fairing's coefficient stands on the floor; sides stay the box's."""
    bare = Skip(length_m=6.0, width_m=2.5, height_m=2.0, wall_m=0.01)
    faired = Skip(length_m=6.0, width_m=2.5, height_m=2.0, wall_m=0.01, fairing_drag=0.4)
    assert faired.drag_area_m2()[2] == pytest.approx(0.4 * 15.0)
    assert faired.drag_area_m2()[:2] == bare.drag_area_m2()[:2]
    assert bare.volume_m3() + bare.inside_m3() == pytest.approx(30.0)


def test_perforation_of_a_template() -> None:
    shut = Template(length_m=10.0, width_m=8.0, height_m=3.0, open_percent=0.0, steel_m3=9.0)
    half = Template(length_m=10.0, width_m=8.0, height_m=3.0, open_percent=50.0, steel_m3=9.0)
    box = Box(length_m=10.0, width_m=8.0, height_m=3.0)
    assert shut.added_mass_m3() == box.added_mass_m3()
    assert half.added_mass_m3()[2] == pytest.approx(exp(-40.0 / 28.0) * box.added_mass_m3()[2])
    assert half.drag_area_m2()[2] == pytest.approx(0.5 * box.drag_area_m2()[2])


@pytest.mark.parametrize(
    "shape",
    [
        SuctionAnchor(diameter_m=1.0, height_m=2.0, wall_m=0.5),
        Skip(length_m=1.0, width_m=1.0, height_m=1.0, wall_m=0.5),
        Template(length_m=1.0, width_m=1.0, height_m=1.0, open_percent=10.0, steel_m3=2.0),
    ],
)
def test_invalid_shapes_are_rejected(shape: SuctionAnchor | Skip | Template) -> None:
    assert "give less" in (shape.check() or "")


def test_the_list_of_shapes() -> None:
    known = {"box", "cylinder", "sphere", "suction_anchor", "skip", "template", "grab"}
    assert set(SHAPES) == known
