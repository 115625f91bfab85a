"""Scenes that cannot be, each refused in one sentence; and what can be, the same in any form.

Materials that once ended the process are tried in a child process.
"""

import subprocess
import sys
import textwrap

import numpy as np
import pytest

from onespp.render.errors import InputError
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import (
    Camera,
    Cylinder,
    Disk,
    Light,
    Mesh,
    Rectangle,
    Scene,
    SceneError,
    Shape,
    Sphere,
)
from onespp.scenes.materials import checks, diffuse, image, srgb8
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.places import ROOT

GRAY = diffuse((0.5, 0.5, 0.5))
EYE = look_at((0.3, 0.2, 4), (0, 0, 0))


def scene(material=GRAY, geometry=None, emission=None, environment=0.5, name="x", camera=None,
          **rest) -> Scene:
    return Scene("t", "t", (Shape(name, geometry or Rectangle(), material, np.eye(4), emission),),
                 camera or Camera(EYE), 2, 8, 6, environment=environment, **rest)


def bare(**properties) -> dict:
    return {"type": "diffuse", **properties}


def seen(made: Scene, channel: str = "emission", frame: int = 0) -> np.ndarray:
    return Renderer(made, 6, 8).frame(frame, 0, (channel,))[channel]


def refused(make, *words: str) -> None:
    """`make` raises one sentence that holds the words."""
    with pytest.raises((SceneError, InputError)) as caught:
        make()
    said = str(caught.value)
    assert "\n" not in said
    for word in words:
        assert word in said, said


def triangle(**attributes) -> Mesh:
    return Mesh(np.eye(3), np.array([[0, 1, 2]]), None, None, attributes)


# Names


@pytest.mark.parametrize("name", ["Cube.001", "type", "environment", "id", "scene", "Würfel 2"])
def test_a_shape_may_have_any_name(name):
    made = scene(name=name, emission=lambda frame: (1, 2, frame))
    assert made.object_names == (name,)
    np.testing.assert_array_equal(seen(made, frame=1)[3, 4], (1, 2, 1))


@pytest.mark.parametrize("name", ["", "a\nb", "\ud800", "a" * 201, 7, None])
def test_a_name_that_cannot_be_written_is_refused(name):
    refused(lambda: scene(name=name), "the name of a shape")


# Materials


@pytest.mark.parametrize(("material", "words"), [
    (bare(reflectence=(0.1, 0.2, 0.3)), ["'x'", "'reflectence'", "did you mean 'reflectance'"]),
    ({"type": "roughplastic", "alfa": 0.1}, ["'x'", "'alfa'", "did you mean 'alpha'"]),
    ({"type": "difuse"}, ["'x'", "'difuse'", "did you mean 'diffuse'"]),
    ({"type": "path"}, ["'x'", "'path'", "there are blendbsdf"]),
    (bare(reflectance={"type": "chequerboard"}), ["'reflectance'", "did you mean 'checkerboard'"]),
    (bare(reflectance={"type": "bitmap", "filename": "no.png"}), ["'x'", "'no.png'", "no such"]),
    (bare(reflectance={"type": "bitmap", "filename": __file__}), ["'x'", "no image"]),
    ({"type": "twosided", "bsdf": {"type": "dielectric"}}, ["'x'", "without a transmission"]),
    (bare(reflectance={"type": "blackbody", "temperature": 5000.0}), ["'x'", "spectral"]),
    ({"type": "normalmap", "normalmap": np.ones((4, 4)), "b": bare()}, ["'x'", "monochromatic"]),
    (bare(reflectance="#ff8800"), ["'x'", "reflectance", "string"]),
    (bare(reflectance={"type": "volume"}), ["'reflectance'", "volume"]),
])
def test_what_mitsuba_does_not_take_is_named(material, words):
    refused(lambda: MitsubaScene(scene(material)), *words)


@pytest.mark.parametrize(("material", "words"), [
    ((1, 0, 0), ["the material of shape 'x' is (1, 0, 0)", "diffuse("]),
    ({}, ["no type"]),
    ({"type": None}, ["no type"]),
    (bare(reflectance={"kind": "bitmap"}), ["'reflectance' of", "no type"]),
    (bare(reflectance=None), ["'reflectance' of the material of shape 'x' is None"]),
    (bare(reflectance=(0.1, 0.2)), ["'reflectance'", "(r, g, b)"]),
    (bare(reflectance=("a", "b", "c")), ["'reflectance'", "numbers"]),
    (bare(reflectance=[[1], [1, 2]]), ["'reflectance'", "one length"]),
    (bare(reflectance=1j), ["'reflectance'", "1j"]),
    (bare(reflectance=1.5), ["'reflectance'", "1.5", "0 to 1"]),
    (bare(reflectance=float("nan")), ["'reflectance'", "not finite"]),
    (bare(reflectance=10**400), ["'reflectance'", "not finite"]),
    (bare(reflectance=(0.5, 1.2, 0)), ["'reflectance'", "1.2", "0 to 1"]),
    (bare(reflectance=(0.5, -1, 0)), ["'reflectance'", "-1"]),
    ({"type": "mask", "opacity": np.full((2, 2), np.nan), "b": bare()}, ["'opacity'", "finite"]),
    ({"type": "roughplastic", "int_ior": -1.0}, ["'int_ior'", "-1"]),
    ({"type": "dielectric", "int_ior": 0.0}, ["'int_ior'", "0.1 to 10"]),  # NaN in frames
    ({"type": "dielectric", "ext_ior": 0.0}, ["'ext_ior'", "0.1 to 10"]),
    (diffuse(np.full((4, 4, 3), 200.0)), ["200", "0 to 1", "srgb8"]),
    (diffuse(np.full((4, 4, 3), -0.1)), ["-0.1"]),
    (diffuse(np.full((4, 4, 3), np.nan)), ["not finite"]),
    (diffuse(np.full((4, 4, 3), 200, np.uint8)), ["uint8", "srgb8"]),
    (diffuse(np.ones((4, 4, 4))), ["(4, 4, 4)"]),
    (bare(**{"a.b": 1.0}), ["'a.b'", "dots"]),
    (bare(reflectance={"type": "checkerboard", "to_uv": 3}), ["'reflectance.to_uv'", "4x4"]),
])
def test_values_that_cannot_be_are_refused_where_the_shape_is_made(material, words):
    refused(lambda: Shape("x", Rectangle(), material), *words)


def test_a_dictionary_inside_itself_is_refused():
    loop: dict = {"type": "twosided"}
    loop["bsdf"] = loop
    refused(lambda: Shape("x", Rectangle(), loop), "deep")


@pytest.mark.parametrize("value", [
    [0.1, 0.2, 0.3], np.array([0.1, 0.2, 0.3]), (np.float64(0.1), np.float64(0.2), 0.3),
    {"type": "rgb", "value": (0.1, 0.2, 0.3)}, np.tile((0.1, 0.2, 0.3), (2, 2, 1)),
    image(np.tile((0.1, 0.2, 0.3), (2, 2, 1)))])
def test_a_colour_is_the_same_in_any_form(value):
    albedo = seen(scene(diffuse(value)), "albedo")
    np.testing.assert_allclose(albedo[3, 4], (0.1, 0.2, 0.3), rtol=1e-3)


# Each of these ended the process with a segmentation fault, or would if it came to Mitsuba.
DEADLY = {
    "None": {"type": "diffuse", "reflectance": None},
    "no bsdf": {"type": "twosided", "bsdf": None},
    "no pixels": "diffuse(np.zeros((0, 0, 3)))",
    "no column": "diffuse({'type': 'bitmap', 'bitmap': np.zeros((4, 0, 3))})",
    "no image": {"type": "diffuse", "reflectance": {"type": "bitmap"}},
    "no volume": {"type": "diffuse", "reflectance": {"type": "volume"}},
    "no weight": {"type": "blendbsdf"},
    "one half": {"type": "blendbsdf", "weight": 0.5, "a": {"type": "diffuse"}},
    "half in a texture": {"type": "diffuse", "reflectance": {"type": "blendbsdf"}},
}


def test_materials_that_killed_the_process_are_refused():
    """In one child for all of them: it goes on after each, and ends well."""
    program = textwrap.dedent("""
        import numpy as np
        from tests.scenes.test_scene_mistakes import MitsubaScene, scene
        from onespp.scenes.description import SceneError
        from onespp.scenes.materials import diffuse
        for material in ({materials}):
            try:
                MitsubaScene(scene(material))
            except SceneError as error:
                print("SAID", error)
    """).format(materials=", ".join(m if isinstance(m, str) else repr(m) for m in DEADLY.values()))
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, text=True,
                          capture_output=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("SAID") == len(DEADLY), done.stdout


COLOR = {"type": "mesh_attribute", "name": "vertex_color"}


@pytest.mark.parametrize(("material", "words"), [
    (diffuse({**COLOR, "name": "vertex_colour"}), ["'vertex_colour'", "has face_w, vertex_color"]),
    (diffuse({**COLOR, "name": 3.0}), ["mesh_attribute 3.0"]),
    (diffuse({"type": "mesh_attribute"}), ["mesh_attribute None"]),
    (diffuse({**COLOR, "scale": 2.0}), ["2 times the attribute 'vertex_color'", "0 to 1"]),
    (diffuse({**COLOR, "scale": -1.0}), ["-1 times", "0 to 1"]),
    (diffuse({**COLOR, "scale": "much"}), ["scale'", "'much'"]),
    ({"type": "principled", "roughness": COLOR}, ["'roughness' of", "needs rows of 1", "of 3"]),
    ({"type": "normalmap", "normalmap": {**COLOR, "name": "face_w"}, "b": bare()},
     ["'normalmap' of", "needs rows of 3", "'face_w'", "of 1"]),
    ({"type": "mask", "b": bare(), "opacity": {
        "type": "onespp_product", "factor_0": 0.5, "factor_1": COLOR}},
     ["'opacity.factor_1'", "needs rows of 1"])])
def test_data_that_a_mesh_does_not_have_are_refused_by_name(material, words):
    mesh = triangle(vertex_color=np.eye(3), face_w=[[0.5]])
    refused(lambda: Shape("x", mesh, material), "material of shape 'x'", *words)


@pytest.mark.parametrize("geometry", [Rectangle(), Sphere(), triangle()])
def test_data_of_vertices_are_of_meshes_that_have_them(geometry):
    refused(lambda: Shape("x", geometry, diffuse(COLOR)), "mesh_attribute 'vertex_color'",
            "shape 'x'", "has none" if isinstance(geometry, Mesh) else "is no mesh")


@pytest.mark.parametrize("make", [
    lambda: Shape("x", triangle(vertex_color=np.eye(3)), GRAY, np.eye(4), COLOR),
    lambda: Light({"type": "spot", "texture": COLOR}),
    lambda: Light({"type": "directional", "irradiance": COLOR}),
    lambda: scene(environment={"type": "sunsky", "albedo": COLOR})])
def test_lights_do_not_shine_by_data_of_vertices(make):
    """Mitsuba's own path, at a lamp like that, has a hundredth of its light."""
    refused(make, "mesh_attribute", "use a colour or an image")


# 8-bit pictures


def test_srgb8_is_linear_light():
    codes = np.array([[0, 10, 11, 128, 255]], np.uint8)
    expected = [0, 10 / 255 / 12.92, ((11 / 255 + 0.055) / 1.055) ** 2.4, 0.2158605, 1]
    found = srgb8(codes)
    assert found.shape == (1, 5, 3)
    np.testing.assert_allclose(found, np.tile(np.array(expected)[None, :, None], 3), atol=1e-7)
    opaque = np.dstack([codes] * 3 + [np.full_like(codes, 255)])
    np.testing.assert_array_equal(srgb8(opaque), found)


def test_srgb8_reads_pillow_images_with_palettes():
    pil = pytest.importorskip("PIL.Image")
    red = pil.new("RGB", (2, 3), (255, 0, 128))
    expected = np.tile((1, 0, 0.2158605), (3, 2, 1))
    for picture in (red, red.convert("RGBA"), red.quantize(4)):
        np.testing.assert_allclose(srgb8(picture), expected, atol=1e-7)
    refused(lambda: srgb8(red.convert("F")), "mode F")


@pytest.mark.parametrize(("pixels", "words"), [
    (np.ones((2, 2, 3)), ["float64"]), (np.ones((2, 2, 3), np.uint16), ["uint16"]),
    (np.ones((2, 2, 2), np.uint8), ["(2, 2, 2)"]), (np.ones((0, 2), np.uint8), ["(0, 2)"]),
    (np.ones((2, 2, 4), np.uint8), ["transparent"])])
def test_srgb8_refuses_what_is_no_8_bit_picture(pixels, words):
    refused(lambda: srgb8(pixels), *words)


@pytest.mark.parametrize("use", [
    lambda pixels: image(pixels),
    lambda pixels: scene(environment=pixels),
    lambda pixels: scene(emission=pixels),
    lambda pixels: scene(diffuse(pixels)),
])
def test_8_bit_pictures_are_refused_wherever_an_image_may_be(use):
    pixels = np.full((4, 8, 3), 200, np.uint8)
    refused(lambda: use(pixels), "uint8", "srgb8")
    use(srgb8(pixels))


# Light


@pytest.mark.parametrize("emission", [
    5.0, 5, np.float32(5), (np.float32(5), np.int64(5), 5), [5, 5, 5], np.full(3, 5.0),
    {"type": "rgb", "value": (5, 5, 5)}, {"type": "area", "radiance": 5.0}, lambda frame: 5,
    lambda frame: np.full(3, 5.0), {"type": "uniform", "value": 5.0}, np.full((4, 4, 3), 5.0)])
def test_emission_is_the_same_in_any_form(emission):
    np.testing.assert_allclose(seen(scene(emission=emission))[3, 4], 5)


@pytest.mark.parametrize(("emission", "words"), [
    ((1, 2), ["(r, g, b)"]), ((-1, 0, 0), ["-1"]), (float("nan"), ["not finite"]),
    (1e20, ["1e+20", "0 to 1e+12"]), ((0, 1e20, 0), ["0 to 1e+12"]),
    (np.full((4, 4, 3), 1e20), ["0 to 1e+12"]), (lambda frame: 1e20, ["frame 0", "0 to 1e+12"]),
    (True, ["True"]), ("no.png", ["'no.png'"]), (np.full((4, 4, 3), np.inf), ["not finite"]),
    (lambda frame: None, ["in frame 0", "None"]), (lambda frame: -1, ["in frame 0", "-1"]),
    (lambda frame: 1 / frame, ["in frame 0", "ZeroDivisionError"]),
    (lambda frame: np.ones((2, 2, 3)), ["in frame 0", "texture"]),
    (lambda frame: sys.exit(0), ["in frame 0", "SystemExit"]),  # ended well, without a frame
    ({"type": "point"}, ["'point'"]), ({"type": "blackbody", "temperature": 5e3}, ["spectral"]),
    (checks((0, 0, 0), (5, 5, 5)), ["color1", "5"])])
def test_emission_that_cannot_be_is_refused(emission, words):
    refused(lambda: MitsubaScene(scene(emission=emission)), "emission of", "'x'", *words)


@pytest.mark.parametrize("geometry", [Rectangle(), Disk(), Sphere(), Cylinder()],
                         ids=lambda geometry: type(geometry).__name__)
def test_an_image_that_glows_lights_as_its_colour_does(geometry):
    def floor_lit_by(emission):
        floor = Shape("floor", Rectangle(), GRAY, rotate((1, 0, 0), -90) @ scale(3))
        lamp = Shape("lamp", geometry, diffuse((0, 0, 0)), translate((0, 1.2, 0))
                     @ rotate((1, 0, 0), 90) @ scale(0.4), emission)
        made = Scene("t", "t", (floor, lamp), Camera(look_at((0, 3, 6), (0, 0, 0))), 2, 12, 12, 2)
        return Renderer(made, 12, 12).sample_sum(0, 1, 0, 256).mean() / 256

    assert floor_lit_by(np.full((8, 8, 3), 2.0)) == pytest.approx(floor_lit_by(2), rel=0.03)


@pytest.mark.parametrize("environment", [0.5, np.float32(0.5), [0.5] * 3, np.full(3, 0.5)])
def test_environment_is_the_same_in_any_form(environment):
    assert scene(environment=environment).environment == (0.5, 0.5, 0.5)


@pytest.mark.parametrize("size", [(1, 1), (1, 3), (2, 2), (5, 4)])
def test_environment_image_of_any_size_and_file(size, tmp_path):
    from onespp.render.mitsuba.variant import mi

    pixels = np.random.default_rng(1).random((*size, 3)).astype(np.float32)
    mi.Bitmap(pixels).write(str(tmp_path / "sky.exr"))
    expected = seen(scene(environment=pixels))
    assert np.isfinite(expected).all()
    for path in (tmp_path / "sky.exr", str(tmp_path / "sky.exr")):
        np.testing.assert_allclose(seen(scene(environment=path)), expected, rtol=2e-3)


@pytest.mark.parametrize(("environment", "words"), [
    ("no.exr", ["'no.exr'"]), (__file__, ["no image"]), (np.ones((4, 4)), ["(h, w, 3)"]),
    (np.ones((0, 4, 3)), ["pixels"]), (-np.ones((4, 8, 3)), ["-1"]), (lambda frame: 1, ["number"]),
    (np.full((4, 8, 3), np.nan), ["not finite"]), ({"type": "sky"}, ["sunsky"]), (-1, ["-1"]),
    ({"type": "envmap"}, ["without an image"]), ({"type": "sunsky", "haze": 1.0}, ["'haze'"]),
    ({"type": "sunsky", "sun_direction": (0, 1)}, ["sun_direction", "three numbers"])])
def test_environment_that_cannot_be_is_refused(environment, words):
    refused(lambda: MitsubaScene(scene(environment=environment)),
            "environment of scene 't'", *words)


@pytest.mark.parametrize(("light", "words"), [
    (lambda: Light({"type": "area"}), ["point, spot, directional"]),
    (lambda: Light({"type": "point", "position": (0, 1, 0)}), ["world_from_light"]),
    (lambda: Light({"type": "point", "intensity": (-1, 0, 0)}), ["'intensity'", "-1"]),
    (lambda: MitsubaScene(scene(lights=(Light({"type": "spot", "width": 3.0}),))), ["'width'"]),
    (lambda: scene(lights=({"type": "point"},)), ["among its lights"]),
    (lambda: Camera(np.eye(4), 40, "z"), ["fov_axis is 'z'", "smaller or larger"])])
def test_lights_and_axes_that_cannot_be_are_refused(light, words):
    refused(light, *words)


def test_values_in_image_files_are_checked_too(tmp_path):
    from onespp.render.mitsuba.variant import mi

    for name, value in (("bright", 2.0), ("negative", -1.0), ("nan", np.nan)):
        path = tmp_path / f"{name}.exr"
        mi.Bitmap(np.full((4, 8, 3), value, np.float32)).write(str(path))
        refused(lambda path=path: MitsubaScene(scene(bare(
            reflectance={"type": "bitmap", "filename": str(path)}))), "'x'", path.name)
        if name != "bright":
            refused(lambda path=path: MitsubaScene(scene(environment=path)),
                    "environment", path.name)


# Geometry, sizes, cameras


@pytest.mark.parametrize(("make", "words"), [
    (lambda: Mesh(np.zeros((3, 3)), np.zeros((0, 3), int)), ["no faces"]),
    (lambda: Mesh([], []), ["vertices"]),
    (lambda: Mesh(4, 4), ["vertices"]),
    (lambda: Mesh([[0, 0], [1]], [[0, 1, 2]]), ["vertices"]),
    (lambda: Mesh(np.eye(3), [[0, 1, 2], [1]]), ["faces"]),
    (lambda: Mesh(np.full((3, 3), np.nan), [[0, 1, 2]]), ["vertices", "finite"]),
    (lambda: Mesh(np.eye(3), [[0, 1, 2]], np.full((3, 3), np.inf)), ["normals", "finite"]),
    (lambda: Mesh(np.eye(3), [[0, 1, 2]], [[0, 0, 1], [0, 0, 0], [0, 0, 1]]),
     ["no length at 1 of 3", "as 1:"]),
    (lambda: Mesh(np.eye(3), [[0, 1, -1]]), ["-1"]),
    (lambda: triangle(vertex_color=np.eye(2)), ["'vertex_color'", "(2, 2)", "(3, 1 or 3)"]),
    (lambda: triangle(face_color=np.eye(3)), ["'face_color'", "(1, 1 or 3)"]),
    (lambda: triangle(vertex_color=np.full((3, 3), np.nan)), ["'vertex_color'", "not all finite"]),
    (lambda: triangle(vertex_color=[[1], [1, 2], [3]]), ["'vertex_color'", "rows of 1 or 3"]),
    (lambda: triangle(color=np.eye(3)), ["'color'", "use vertex_ or face_"]),
    (lambda: triangle(vertex_normals=np.eye(3)), ["'vertex_normals'", "but not"]),
    (lambda: Mesh(np.eye(3), [[0, 1, 2]], None, None, 7), ["attributes are 7", "dictionary"]),
    (lambda: Shape("x", Sphere, GRAY), ["'x'", "Sphere()"]),
    (lambda: Shape("x", Sphere(), GRAY, np.eye(3)), ["'x'", "4x4"]),
    (lambda: Shape("x", Sphere(), GRAY, translate((1, 2, 3)).T), ["'x'", "last row"]),
    (lambda: Scene("t", "t", Shape("x", Sphere(), GRAY), Camera(EYE), 2, 8, 6), ["tuple of Shape"]),
    (lambda: Scene("t", "t", ([Shape("x", Sphere(), GRAY)],), Camera(EYE), 2, 8, 6), ["Shape("]),
    (lambda: Scene("t", "t", (Shape("x", Sphere(), GRAY, emission=1),), EYE, 2, 8, 6), ["Camera("]),
    (lambda: scene(max_depth=0), ["max_depth = 0", "1 or more"]),
    (lambda: scene(max_depth=10**400), ["max_depth"]),
    (lambda: scene(max_depth=2.5), ["max_depth = 2.5", "whole"]),
    (lambda: scene(fps="24"), ["fps", "'24'"]),
    (lambda: scene(fps=float("nan")), ["fps"]),
    (lambda: scene(fps=0.5), ["fps = 0.5"]),
    (lambda: Camera(EYE, "40"), ["field of view"]),
    (lambda: Camera(EYE, 180), ["180"]),
])
def test_what_makes_no_scene_is_refused(make, words):
    refused(make, *words)


def test_paths_of_one_segment_render_with_default_options():
    renderer = Renderer(scene(emission=2, max_depth=1), 6, 8, direct="resampled")
    frame = renderer.frame(0, 0, renderer.channels)
    lit = frame["id"] == 0
    np.testing.assert_array_equal(frame["color"][lit], 2)
    np.testing.assert_allclose(frame["color"][~lit], 0.5)
    refused(lambda: renderer.frame(0, 0, ("visibility",)), "max_depth 2")


SHEAR = np.eye(4)
SHEAR[0, 1] = 0.2


@pytest.mark.parametrize(("change", "words"), [
    (SHEAR, ["sheared"]), (scale((1, 1, 2)), ["scales"]), (scale(2), ["scales"]),
    (scale((1, -1, 1)), ["mirrors"]), (np.diag([0.0, 0, 0, 1]), ["scales"]),
    (np.full((4, 4), np.nan), ["4x4"])])
def test_a_camera_that_does_more_than_turn_and_move_is_refused(change, words):
    refused(lambda: Camera(EYE @ change), "'camera'", *words)
    refused(lambda: Camera(lambda frame: EYE @ change).world_from_camera_at(3),
            "'camera' in frame 3", *words)


@pytest.mark.parametrize("geometry", [Sphere(), Cylinder()])
def test_a_sheared_sphere_or_tube_is_refused(geometry):
    """With axes of one length: Mitsuba warns, and renders something else."""
    shear = np.eye(4)
    shear[:3, 1] = np.array([0.7, 1, 0]) / np.hypot(0.7, 1)
    made = Scene("t", "t", (Shape("x", geometry, GRAY, shear),), Camera(EYE), 2, 8, 6,
                 environment=1)
    refused(lambda: MitsubaScene(made), "'x'", "shears")


def test_a_camera_with_rounded_numbers_is_taken():
    turned = look_at((1, 2, 3), (0.3, 0.1, 0))
    for rounded in (turned.astype(np.float32), turned.round(5).tolist()):
        assert Camera(rounded).world_from_camera_at(0).dtype == np.float64


def test_a_shape_that_inherits_from_a_sphere_is_refused():
    class Ball(Sphere):
        pass

    refused(lambda: scene(geometry=Ball()), "the geometry of shape 'x'", "use Sphere()")


def test_a_refused_material_is_no_part_of_later_scenes():
    """Kernels call every live material; the error, which is kept here, must not keep this one."""
    with pytest.raises(SceneError, match="spectral") as kept:
        MitsubaScene(scene(bare(reflectance={"type": "blackbody", "temperature": 5000.0})))
    assert Renderer(scene(diffuse((0.5, 0.5, 0.5))), 4, 4).frame(0)["color"].shape == (4, 4, 3)
    assert kept.value
