"""Guides say what a material does: the normal that it shades with, the alpha of its highlight."""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest

from onespp.render.channels import Group, channels_of
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.camera_rays import pixel_rays
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.transforms import look_at, rotate, scale, translate

HEIGHT, WIDTH = 18, 24
DIFFUSE = {"type": "diffuse", "reflectance": (0.5, 0.5, 0.5)}
SQUARE = Rectangle()
TILT = np.array([0.48, 0.36, 0.8])  # of unit length
WAVES, HEIGHT_OF_WAVES = 3, 0.05


def constant(normal) -> dict:
    """A normal map that is the same everywhere."""
    return {"type": "bitmap", "raw": True,
            "bitmap": np.broadcast_to(0.5 + 0.5 * np.asarray(normal), (4, 4, 3))}


def tilted(inner=DIFFUSE, normal=TILT, **options) -> dict:
    return {"type": "normalmap", "normalmap": constant(normal), "inner": inner, **options}


def wavy(inner=DIFFUSE, **options) -> dict:
    """A sine along u, of `WAVES` waves."""
    u = (np.arange(1024) + 0.5) / 1024
    height = HEIGHT_OF_WAVES * np.sin(2 * np.pi * WAVES * u)
    return {"type": "bumpmap", "inner": inner, **options, "height": {
        "type": "bitmap", "raw": True, "bitmap": np.tile(height[None, :, None], (4, 1, 1))}}


def twosided(inner) -> dict:
    return {"type": "twosided", "inner": inner}


def masked(inner, opacity=0.5) -> dict:
    return {"type": "mask", "opacity": opacity, "inner": inner}


def blend(a, b, weight=0.3) -> dict:
    return {"type": "blendbsdf", "weight": weight, "a": a, "b": b}


def seen(material: dict, geometry=SQUARE, place=None, eye=(0.3, 0.2, 3)) -> tuple:
    """The renderer of one shape before a camera, its frame, and the shape's pixels."""
    lamp = Shape("lamp", Rectangle(), DIFFUSE, translate((0, 9, 0)), (1.0, 1.0, 1.0))
    place = rotate((1, 2, 3), 0) if place is None else place
    scene = Scene("one", "", (Shape("a", geometry, material, place), lamp),
                  Camera(look_at(eye, (0, 0, 0)), 50), 1, WIDTH, HEIGHT, 2)
    renderer = Renderer(scene, HEIGHT, WIDTH)
    frame = renderer.frame(0, 0, (*channels_of(Group.GUIDES), "roughness"))
    return renderer, frame, frame["id"] == 0


def shading_normals(renderer: Renderer, here: np.ndarray) -> np.ndarray:
    """(n, 3) normals of pixels `here` that Mitsuba's own BSDF shades with, from its values.

    A diffuse value is proportional to n . wo, for three wo around the normal in question.
    """
    with dr.suspend_grad():
        pixel = dr.arange(mi.UInt32, HEIGHT * WIDTH)
        row = pixel // WIDTH
        ray, _ = pixel_rays(renderer.stage, HEIGHT, WIDTH).at(
            mi.Float(pixel - row * WIDTH) + 0.5, mi.Float(row) + 0.5)
        si = renderer.stage.mi_scene.ray_intersect(ray)
        side = dr.select(si.wi.z < 0, mi.Float(-1), 1)
        directions = np.array([[0.25, 0, 1], [-0.15, 0.2, 1], [-0.15, -0.2, 1]])
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        rows, values = [], []
        for x, y, z in directions.tolist():
            wo = mi.Vector3f(x, y, z * side)
            values.append(si.bsdf().eval(mi.BSDFContext(), si, wo)[0].numpy())
            rows.append(si.to_world(wo).numpy().T)
    wo, value = np.stack(rows, 1)[here.ravel()], np.stack(values, 1)[here.ravel()]
    solved = np.linalg.solve(wo, value[..., None])[..., 0]
    return solved / np.linalg.norm(solved, axis=1, keepdims=True)


def test_a_constant_normal_map_tilts_the_normal_by_as_much():
    place = rotate((0, 0, 1), 30)
    _, frame, here = seen(tilted(), place=place)
    assert here.sum() > 150
    expected = place[:3, :3] @ TILT
    np.testing.assert_allclose(frame["normal"][here], np.broadcast_to(expected, (here.sum(), 3)),
                               atol=1e-6)


def test_a_sine_bump_has_the_normals_of_its_slope():
    """The rectangle is 2 wide: u = (x + 1) / 2, and height is in scene units."""
    _, frame, here = seen(wavy())
    u = (frame["position"][here][:, 0].astype(np.float64) + 1) / 2
    slope = HEIGHT_OF_WAVES * 2 * np.pi * WAVES * np.cos(2 * np.pi * WAVES * u) / 2
    expected = np.stack([-slope, 0 * slope, np.ones_like(slope)], 1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.abs(slope).max() > 0.4
    np.testing.assert_allclose(frame["normal"][here], expected, atol=5e-3)


def test_twice_the_scale_of_a_bump_is_twice_the_slope():
    _, once, here = seen(wavy())
    _, twice, _ = seen(wavy(scale=2.0))
    slopes = [f["normal"][here][:, 0] / f["normal"][here][:, 2] for f in (once, twice)]
    np.testing.assert_allclose(slopes[1], 2 * slopes[0], rtol=1e-4, atol=1e-6)


def test_a_flat_map_changes_nothing():
    plain = seen(twosided(DIFFUSE), Sphere(), scale(1.2))[1]
    flat = seen(twosided(tilted(normal=(0, 0, 1))), Sphere(), scale(1.2))[1]
    np.testing.assert_allclose(flat["normal"], plain["normal"], atol=2e-6)


NESTS = {"plain": lambda m: m(DIFFUSE), "twosided": lambda m: twosided(m(DIFFUSE)),
         "inside": lambda m: m(twosided(DIFFUSE)), "mask": lambda m: masked(twosided(m(DIFFUSE))),
         "blend": lambda m: twosided(
             blend(m(DIFFUSE), m(DIFFUSE))), "two maps": lambda m: twosided(m(m(DIFFUSE)))}
QUIET = {"use_shadowing_function": False}


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("nest", NESTS)
@pytest.mark.parametrize("what", [tilted, wavy])
@pytest.mark.parametrize("geometry", [Rectangle(), Sphere()])
def test_the_normal_is_the_one_that_the_material_shades_with(what, nest, behind, geometry):
    if nest == "plain" and behind:
        pytest.skip("one-sided materials are black from behind")
    if nest == "two maps" and what is wavy:
        pytest.skip("a bump map in a bump map: see the header of render/appearance.py")
    if behind and isinstance(geometry, Sphere):
        pytest.skip("a ball has no behind")
    gentle = {"normal": np.array([0.15, -0.1, 1]) / np.linalg.norm([0.15, -0.1, 1])}
    options = QUIET | (gentle if what is tilted else {"scale": 0.3})
    material = NESTS[nest](lambda inner: what(inner, **options))
    place = rotate((0, 1, 0), 180 if behind else 20) @ rotate((0, 0, 1), 25)
    renderer, frame, here = seen(material, geometry, place)
    eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
    toward = eye - frame["position"]
    toward /= np.linalg.norm(toward, axis=2, keepdims=True)
    here &= (frame["normal"] * toward).sum(2) > 0.4  # the three directions are above the horizon
    assert here.sum() > 60
    np.testing.assert_allclose(frame["normal"][here], shading_normals(renderer, here), atol=3e-3)


def test_normals_of_maps_have_unit_length_and_face_the_camera():
    steep = np.array([0.9, 0.1, 0.2]) / np.linalg.norm([0.9, 0.1, 0.2])
    for material in (twosided(tilted(normal=steep)), twosided(wavy(scale=20.0)),
                     tilted(glass(), steep), twosided(tilted(normal=(0, 0, 0)))):
        _, frame, here = seen(material, place=rotate((0, 1, 0), 110), eye=(2, 0.2, 2))
        normals = frame["normal"][here]
        eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
        assert here.sum() > 50
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
        assert (np.einsum("ij,ij->i", normals, eye - frame["position"][here]) > -1e-5).all()


def conductor(alpha=0.1, **options) -> dict:
    return {"type": "roughconductor", "distribution": "ggx", "alpha": alpha, **options}


def plastic(alpha=0.1, **options) -> dict:
    return {"type": "roughplastic", "distribution": "ggx", "alpha": alpha, **options}


def glass(alpha=0.15, **options) -> dict:
    return {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha, **options}


def disney(roughness=0.5, **options) -> dict:
    return {"type": "principled", "roughness": roughness, **options}


MIRROR = {"type": "conductor", "material": "none"}
MATERIALS = {
    "chalk": (twosided(DIFFUSE), 1.0),
    "smooth plastic": ({"type": "plastic"}, 0.0),
    "metal 0.1": (conductor(0.1), 0.1),
    "metal 0.3": (conductor(0.3), 0.3),
    "metal 0.8": (twosided(conductor(0.8)), 0.8),
    "beckmann": ({"type": "roughconductor", "distribution": "beckmann", "alpha": 0.2}, 0.2),
    "all normals": (conductor(0.2, sample_visible=False), 0.2),
    "default metal": ({"type": "roughconductor"}, 0.1),
    "brushed": ({"type": "roughconductor", "alpha_u": 0.1, "alpha_v": 0.4}, 0.2),
    "plastic 0.1": (plastic(0.1), 0.1),
    "plastic 0.3": (twosided(plastic(0.3)), 0.3),
    "polarizing plastic": ({"type": "pplastic", "alpha": 0.25}, 0.25),
    "glass": (glass(0.15), 0.15),
    "rougher glass": (glass(0.5, int_ior=1.1), 0.5),
    "principled 0.5": (disney(0.5), 0.25),
    "principled 0.2": (disney(0.2), 0.04),
    "principled 0.9": (disney(0.9), 0.81),
    "principled 0": (disney(0.0), 0.001),
    "principled tinted": (disney(0.5, spec_tint=0.7), 0.25),
    "principled metal": (disney(0.3, metallic=1.0), 0.09),
    "principled glass": (disney(0.4, spec_trans=0.8), 0.16),
    "principled brushed": (disney(0.4, anisotropic=0.7), 0.16),
    "principled coated": (disney(0.5, clearcoat=1.0, clearcoat_gloss=0.9), 0.25),
    "principled two-sided": (twosided(disney(0.6)), 0.36),
    "principled thin": ({"type": "principledthin", "roughness": 0.5}, 0.25),
    "mask of chalk": (masked(twosided(DIFFUSE)), 0.0),  # of what is seen through it
    "mask of metal": (masked(conductor(0.3)), 0.3),
    "mask of plastic": (masked(twosided(plastic(0.1))), 0.1),
    "mask of principled": (masked(disney(0.5), 0.9), 0.25),
    "mask of a mirror": (masked(MIRROR), 0.0),
    "blend of chalk and metal": (blend(DIFFUSE, conductor(0.3)), 0.3),
    "blend of two metals": (blend(conductor(0.4), conductor(0.2)), 0.2),
    "blend that is all chalk": (blend(DIFFUSE, conductor(0.3), 0.0), 1.0),
    "blend that is all metal": (blend(MIRROR, conductor(0.3), 1.0), 0.3),
    "bumpy metal": (wavy(conductor(0.3)), 0.3),
    "tilted plastic": (twosided(tilted(plastic(0.3))), 0.3),
    "mask of a blend": (masked(twosided(blend(DIFFUSE, plastic(0.3)))), 0.3),
}


@pytest.mark.parametrize("name", MATERIALS)
def test_roughness_is_the_alpha_of_every_material(name):
    material, alpha = MATERIALS[name]
    _, frame, here = seen(material)
    assert here.sum() > 150
    np.testing.assert_allclose(frame["roughness"][here], alpha, atol=1e-6)
    assert (frame["roughness"][frame["id"] < 0] == 1).all()


def test_roughness_follows_textures_point_by_point():
    """Left and right halves: two alphas, an opaque part and a hole, one material and another.
    (Holes, mirrors and panes have no pixels of theirs: tests/render/tracer/test_replacement.py.)"""
    halves = {"type": "checkerboard", "color0": 0.1, "color1": 0.4}
    only = {"type": "checkerboard", "color0": 0.0, "color1": 1.0}
    for material, values in ((conductor(halves), {0.1, 0.4}), (disney(halves), {0.01, 0.16}),
                             (masked(twosided(conductor(0.3)), only), {0.3}),
                             (blend(DIFFUSE, conductor(0.3), only), {1.0, 0.3})):
        _, frame, here = seen(material)
        found = np.unique(frame["roughness"][here].astype(np.float64).round(5))
        assert set(found.tolist()) == values


def test_roughness_is_that_of_the_side_that_is_seen():
    sides = {"type": "twosided", "a_front": DIFFUSE, "b_back": conductor(0.3)}
    for degrees, alpha in ((0, 1.0), (180, 0.3)):
        _, frame, here = seen(sides, place=rotate((0, 1, 0), degrees))
        np.testing.assert_allclose(frame["roughness"][here], alpha, atol=1e-6)


CHALK = {"type": "diffuse", "reflectance": (0.2, 0.3, 0.4)}
PAINT = {"diffuse_reflectance": (0.2, 0.3, 0.4)}
ALBEDOS = {
    "chalk": (CHALK, 1.0),
    "polarizing plastic": ({"type": "pplastic", "alpha": 0.1, **PAINT}, 1.0),
    "plastic": (twosided(plastic(0.1, **PAINT)), 1.0),
    "blend with metal": (blend(CHALK, conductor(0.1), 0.25), 0.75),
    "blend with a mirror": (blend(MIRROR, CHALK, 0.25), 0.25),
    "blend with plastic": (twosided(blend(CHALK, plastic(0.1, **PAINT))), 1.0),
    "bumpy blend": (wavy(blend(CHALK, conductor(0.1), 0.5)), 0.5),
    "mask of a blend": (masked(blend(CHALK, conductor(0.1), 0.5), 1.0), 0.5),
    "half a metal": (disney(base_color=(0.2, 0.3, 0.4), metallic=0.5), 0.5),
    "half a glass": (disney(base_color=(0.2, 0.3, 0.4), metallic=0.2, spec_trans=0.5), 0.4),
    "chalk before metal": ({"type": "twosided", "a": CHALK, "b": conductor(0.1)}, 1.0),
}


@pytest.mark.parametrize("name", ALBEDOS)
def test_albedo_is_of_what_is_diffuse_alone(name):
    """Seen along the normal, where a highlight would be brightest."""
    material, share = ALBEDOS[name]
    _, frame, here = seen(material, eye=(0.01, 0.01, 3))
    expected = np.tile(np.array((0.2, 0.3, 0.4)) * share, (here.sum(), 1))
    np.testing.assert_allclose(frame["albedo"][here], expected, atol=2e-3)


@pytest.mark.parametrize("material", [
    conductor(0.1), MIRROR, glass(), blend(CHALK, conductor(0.1), 1.0),
    blend(MIRROR, conductor(0.1))])
def test_albedo_is_one_where_nothing_is_diffuse(material):
    _, frame, here = seen(material)
    assert (frame["albedo"][here] == 1).all()


def test_albedo_is_that_of_the_side_that_is_seen():
    sides = {"type": "twosided", "a_front": CHALK, "b_back": conductor(0.1)}
    _, frame, here = seen(sides, place=rotate((0, 1, 0), 180))
    assert (frame["albedo"][here] == 1).all()
