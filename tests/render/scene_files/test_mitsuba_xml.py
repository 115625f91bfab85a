"""Scenes of Mitsuba XML files look as Mitsuba's `path` makes them, or are refused in a sentence."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

import onespp
from onespp.render.files.sequence import FrameSequence
from onespp.render.mitsuba import pictured_lamps
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.render.scene_files.extent import bounds
from onespp.render.scene_files.mitsuba_xml import load_xml
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.animation import spin
from onespp.scenes.description import LONGEST_PATH, SceneError
from onespp.scenes.fingerprint import fingerprint
from tests.support import brightness
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance
from tests.support.xml_scenes import SCENES, painted, write_png, write_quad


def scene_xml(inside: str, sensor: str = '<float name="fov" value="50"/>', depth: int = 3,
              width: int = 24, height: int = 16) -> str:
    return f"""<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>
  <sensor type="perspective">{sensor}
    <transform name="to_world"><lookat origin="0.5, 1.5, 4" target="0, 0.4, 0" up="0, 1, 0"/>
    </transform>
    <film type="hdrfilm"><integer name="width" value="{width}"/>
      <integer name="height" value="{height}"/><rfilter type="box"/></film></sensor>
  {inside}</scene>"""


GROUND = """<shape type="rectangle" id="ground"><transform name="to_world"><scale value="4"/>
  <rotate x="1" angle="-90"/></transform></shape>"""
BALL = '<shape type="sphere" id="ball"><float name="radius" value="0.5"/></shape>'
SKY = '<emitter type="constant"/>'


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "a.xml"
    path.write_text(text)
    return path


def means(path: Path, spp: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean colours of a file's renders, by Mitsuba and by us."""
    scene = mi.load_file(str(path), **({"filter": "box"} if "$filter" in path.read_text() else {}))
    return brightness.means(scene, load_xml(path).scene, spp)


@pytest.mark.parametrize("name", [
    *("indoor", "glass", "foliage", "lights", "painted"),
    *(pytest.param(name, marks=pytest.mark.slow) for name in ("many", "metals"))])
def test_a_scene_is_as_bright_as_mitsubas(name: str, tmp_path: Path):
    write = (SCENES | {"painted": painted})[name]
    brightness.assert_as_bright(*means(write(tmp_path), spp=64))


@pytest.mark.parametrize("name", [
    "glass", *(pytest.param(name, marks=pytest.mark.slow) for name in ("indoor", "foliage"))])
def test_frames_have_the_mean_of_the_reference(name: str, tmp_path: Path):
    scene = load_xml(SCENES[name](tmp_path)).scene
    renderer = Renderer(scene, 16, 24, direct="resampled", sampler="zsobol")
    frames = [blocks(renderer.frame(0, seed, ("color",))["color"], 8) for seed in range(80)]
    reference = [blocks(renderer.sample_sum(0, 9, k, 64) / 64, 8) for k in range(16)]
    assert_same_mean(*mean_and_variance(frames), *mean_and_variance(reference))


def test_a_file_is_denoised_and_scored_like_any_scene(tmp_path: Path):
    scene = onespp.animate(SCENES["foliage"](tmp_path), camera="dolly", moves={"cloth": "swing"})
    sequence = onespp.render(scene, tmp_path / "out", frames=3, size=(32, 48), reference_spp=64)
    onespp.denoise(sequence, "onespp")
    scores = onespp.score(sequence)
    after, before = (scores.methods[name]["psnr_srgb"] for name in ("onespp", "input"))
    assert after is not None
    assert before is not None
    assert after > before + 5


@pytest.mark.parametrize("light", [
    '<emitter type="point"><point name="position" value="1, 2, 1"/>'
    '<rgb name="intensity" value="6, 5, 4"/></emitter>',
    '<emitter type="spot"><rgb name="intensity" value="20, 30, 40"/>'
    '<float name="cutoff_angle" value="25"/><transform name="to_world">'
    '<lookat origin="1, 3, 1" target="0, 0, 0" up="1, 0, 0"/></transform></emitter>',
    '<emitter type="directional"><vector name="direction" value="-1, -2, 0.5"/>'
    '<spectrum name="irradiance" value="3"/></emitter>'])
def test_lights_without_a_surface_give_the_same_pixels(light: str, tmp_path: Path):
    path = written(tmp_path, scene_xml(GROUND + BALL + light, depth=2))
    theirs = np.array(mi.render(mi.load_file(str(path)), spp=256))[..., :3]
    scene = load_xml(path).scene
    ours = Renderer(scene, 16, 24).sample_sum(0, 1, 0, 256, antialias=True) / 256
    assert theirs.mean() > 0.02
    assert abs(ours - theirs).mean() < 0.03 * theirs.mean()  # edges within pixels
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=5e-3)


def test_a_number_is_white_whatever_it_is_the_light_of(tmp_path: Path):
    path = written(tmp_path, scene_xml(
        GROUND + BALL + '<shape type="sphere" id="lamp"><point name="center" value="1, 2, 1"/>'
        '<float name="radius" value="0.3"/><emitter type="area"><float name="radiance" value="3"/>'
        '</emitter></shape><emitter type="constant"><float name="radiance" value="0.1"/></emitter>'
        '<emitter type="point"><point name="position" value="-1, 2, 1"/>'
        '<integer name="intensity" value="1"/></emitter>'
        '<emitter type="spot"><float name="intensity" value="1.5"/></emitter>'
        '<emitter type="directional"><vector name="direction" value="-1, -2, -1"/>'
        '<float name="irradiance" value="0.2"/></emitter>'))
    theirs, ours = means(path, 64)
    np.testing.assert_allclose(theirs.mean(0), theirs.mean(), rtol=1e-3)
    brightness.assert_as_bright(theirs, ours)
    scene = load_xml(path).scene
    assert [scene.environment, scene.shapes[2].emission] == [(0.1,) * 3, (3.0,) * 3]
    assert [light.emitter["intensity" if i < 2 else "irradiance"]
            for i, light in enumerate(scene.lights)] == [(1.0,) * 3, (1.5,) * 3, (0.2,) * 3]


def test_a_sky_with_a_sun_is_as_bright_as_mitsubas(tmp_path: Path):
    theirs, ours = means(written(tmp_path, scene_xml(
        GROUND + BALL + '<emitter type="sunsky"><float name="turbidity" value="4"/>'
        '<vector name="sun_direction" value="0.3, -0.4, 0.8"/><float name="sun_scale" value="0.2"/>'
        '<transform name="to_world"><rotate x="1" angle="-90"/></transform></emitter>')), spp=64)
    np.testing.assert_allclose(ours.mean(0), theirs.mean(0), rtol=0.01)


@pytest.mark.parametrize(("uv", "by_area"), [(1, False), (1, True), (2, True)])
def test_a_picture_on_a_mesh_shines_as_on_mitsubas_rectangle(
        uv: int, by_area: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """One that covers the mesh once, and one that covers it four times, which is drawn by area."""
    if by_area and uv == 1:  # as on CUDA
        monkeypatch.setattr(pictured_lamps, "is_found", lambda *_: False)
    to_uv = f'<transform name="to_uv"><scale x="{uv}" y="{uv}"/></transform>'
    write_quad(tmp_path / "lamp.obj", uv)
    pixels = np.zeros((4, 4, 3))
    pixels[:, 3], pixels[0, :2] = (1, 0.5, 0.2), (0.2, 0.3, 1)
    write_png(tmp_path / "lamp.png", pixels)

    def lamp(shape: str, inside: str = "") -> str:
        return scene_xml(
            f'{GROUND}{BALL}<shape {shape}<transform name="to_world"><rotate x="1" angle="90"/>'
            '<translate y="3"/></transform><emitter type="area"><texture type="bitmap" '
            f'name="radiance"><string name="filename" value="lamp.png"/>{inside}</texture>'
            '</emitter></shape>')

    brightness.assert_as_bright(*brightness.means(
        mi.load_file(str(written(tmp_path, lamp('type="rectangle">', to_uv if uv > 1 else "")))),
        load_xml(written(tmp_path, lamp(
            'type="obj"><string name="filename" value="lamp.obj"/>'))).scene, 4096))


def test_a_mesh_without_uv_shines_by_the_barycentric_coordinates_of_its_faces(tmp_path: Path):
    """As one whose faces all have the same half of the picture (v of an OBJ goes up)."""
    write_png(tmp_path / "lamp.png", np.random.default_rng(2).random((4, 4, 3)))
    corners = "".join(f"v {x} {y} 0\n" for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    frames = []
    for name, faces in (("without", "f 1 2 3\nf 1 3 4\n"),
                        ("with", "vt 0 1\nvt 1 1\nvt 0 0\nf 1/1 2/2 3/3\nf 1/1 3/2 4/3\n")):
        (tmp_path / f"{name}.obj").write_text(corners + faces)
        scene = load_xml(written(tmp_path, scene_xml(
            f'{GROUND}{BALL}<shape type="obj"><string name="filename" value="{name}.obj"/>'
            '<transform name="to_world"><rotate x="1" angle="90"/><translate y="3"/></transform>'
            '<emitter type="area"><texture type="bitmap" name="radiance">'
            '<string name="filename" value="lamp.png"/></texture></emitter></shape>'))).scene
        frames.append(Renderer(scene, 16, 24).sample_sum(0, 1, 0, 16) / 16)
    assert frames[0].mean() > 0.005
    np.testing.assert_allclose(*frames, rtol=1e-3, atol=1e-4)


def test_the_light_of_a_point_in_a_tiny_scene_falls_as_in_a_large_one(tmp_path: Path):
    """Tiny scenes are built in units of their own."""
    light = ('<emitter type="point"><point name="position" value="0, 2, 1"/>'
             '<rgb name="intensity" value="6"/></emitter>')
    scene = load_xml(written(tmp_path, scene_xml(GROUND + BALL + light, depth=2))).scene
    small = np.diag([1e-3, 1e-3, 1e-3, 1])

    def shrunk(matrix: np.ndarray, size: np.ndarray) -> np.ndarray:
        moved = small @ matrix
        moved[:3, :3] = size @ matrix[:3, :3]
        return moved

    assert not callable(scene.camera.world_from_camera)
    tiny = dataclasses.replace(
        scene,
        shapes=tuple(dataclasses.replace(s, world_from_object=small @ s.world_from_object)
                     for s in scene.shapes),
        camera=dataclasses.replace(scene.camera, world_from_camera=shrunk(
            scene.camera.world_from_camera, np.eye(3))),
        lights=tuple(dataclasses.replace(light, world_from_light=shrunk(
            light.world_from_light, np.eye(3))) for light in scene.lights))
    large = Renderer(scene, 8, 8).frame(0)["color"]
    assert MitsubaScene(tiny).unit < 1
    np.testing.assert_allclose(Renderer(tiny, 8, 8).frame(0)["color"], large * 1e6, rtol=1e-3)


@pytest.mark.parametrize("sensor", [
    *(f'<float name="fov" value="50"/><string name="fov_axis" value="{axis}"/>'
      for axis in ("x", "y", "Y", "smaller", "larger", "diagonal")),
    '<string name="focal_length" value="35mm"/>', ""])
def test_each_field_of_view_is_mitsubas(sensor: str, tmp_path: Path):
    path = written(tmp_path, scene_xml(GROUND + SKY, sensor))
    theirs = mi.load_file(str(path)).sensors()[0]
    ray, _ = theirs.sample_ray(0, 0.5, mi.Point2f(1 / 24, 2 / 16), mi.Point2f(0.5))
    scene = load_xml(path).scene
    screen = scene.camera.screen_from_camera(16, 24) @ np.linalg.inv(
        scene.camera.world_from_camera_at(0))
    x, y, _, w = screen @ [*np.array(ray.o + 2 * ray.d).ravel(), 1]
    np.testing.assert_allclose((x / w, y / w), (1, 2), atol=1e-3)


def test_a_camera_that_mirrors_shows_what_mitsubas_shows(tmp_path: Path):
    light = '<emitter type="point"><point name="position" value="1, 2, 1"/></emitter>'
    path = written(tmp_path, scene_xml(GROUND + BALL + light, depth=2).replace(
        "<lookat", '<scale x="-1"/><lookat'))
    theirs = np.array(mi.render(mi.load_file(str(path)), spp=256))[..., :3]
    scene = load_xml(path).scene
    renderer = Renderer(scene, 16, 24)
    ours = renderer.sample_sum(0, 1, 0, 256, antialias=True) / 256
    off, off_mirrored = (abs(ours - image).mean() for image in (theirs, theirs[:, ::-1]))
    assert off < 0.03 * theirs.mean() < off_mirrored / 4
    for at in (0, 5):
        moved = Renderer(onespp.animate(scene, camera="orbit"), 16, 24).frame(at)
        points = np.concatenate([moved["position"], np.ones((16, 24, 1))], -1)
        x, y, _, w = np.moveaxis(points @ moved.screen_from_world.T, -1, 0)
        there = moved["id"] >= 0
        assert np.linalg.det(moved.camera_from_world) < 0
        np.testing.assert_allclose((x / w)[there], (np.mgrid[:16, :24][1] + 0.5)[there], atol=1e-3)
        np.testing.assert_allclose((y / w)[there], (np.mgrid[:16, :24][0] + 0.5)[there], atol=1e-3)


SHAPES = {
    "sphere": '<point name="center" value="0.1, 0.2, 0"/><float name="radius" value="0.7"/>',
    "rectangle": "", "disk": "", "cube": "",
    "cylinder": '<point name="p0" value="0, -0.5, 0"/><point name="p1" value="0.3, 1.5, 0"/>'
                '<float name="radius" value="0.4"/>',
    "obj": '<string name="filename" value="a.obj"/>',
    "obj without normals": '<string name="filename" value="bare.obj"/>',
    "ply without normals": '<string name="filename" value="a.ply"/>',
    "ply": '<string name="filename" value="a.ply"/><boolean name="face_normals" value="true"/>'}
BARE = ("obj without normals", "ply without normals", "ply")
TURNED = "<rotate x='1' angle='40'/><rotate z='1' angle='20'/>"
MIRRORED = "<scale x='-1'/><rotate y='1' angle='30'/>"
REFLECTED = "<scale x='-1'/><rotate z='1' angle='25'/>"
STRETCHED = "<scale x='1.5' y='-0.7' z='0.5'/><rotate x='1' angle='30'/>"


@pytest.mark.parametrize("flip", ["false", "true"])
@pytest.mark.parametrize(("plugin", "turn", "instance"), [
    *((plugin, *turns) for plugin in SHAPES for turns in (
        (TURNED, ""), (MIRRORED, ""), (TURNED, REFLECTED), (MIRRORED, REFLECTED))),
    *((plugin, STRETCHED, "") for plugin in ("cube", "obj", *BARE))])
def test_shapes_are_where_mitsubas_are_and_face_as_they_do(
        plugin: str, turn: str, instance: str, flip: str, tmp_path: Path):
    from onespp.scenes import meshes
    from tests.support.xml_scenes import write_obj, write_ply

    mesh = meshes.torus(0.8, 0.4, 12)
    write_obj(tmp_path / "a.obj", mesh)
    write_obj(tmp_path / "bare.obj", mesh, normals=False)
    write_ply(tmp_path / "a.ply", mesh)
    text = (f'<shape type="{plugin.split()[0]}">{SHAPES[plugin]}'
            f'<boolean name="flip_normals" value="{flip}"/>'
            f'<transform name="to_world">{turn}<translate y="0.3"/></transform></shape>')
    if instance:
        text = (f'<shape type="shapegroup" id="group">{text}</shape><shape type="instance">'
                f'<transform name="to_world">{instance}</transform><ref id="group"/></shape>')
    path = written(tmp_path, scene_xml(text + SKY))
    theirs = mi.load_file(str(path))
    stage = MitsubaScene(load_xml(path).scene)
    grid = np.stack(np.meshgrid(np.linspace(-0.4, 0.45, 5), np.linspace(-0.4, 0.3, 4)), -1)
    directions = np.concatenate([grid.reshape(-1, 2), -np.ones((20, 1))], 1)

    def hit(scene, origin) -> tuple[np.ndarray, np.ndarray]:
        eye = mi.Point3f(*map(float, np.array([0.1, 0.4, 3]) - origin))
        si = scene.ray_intersect(mi.Ray3f(eye, mi.Vector3f(directions.T.astype(np.float32))))
        return np.array(si.t), np.array(si.sh_frame.n).T

    (t, n), (our_t, our_n) = hit(theirs, np.zeros(3)), hit(stage.mi_scene, stage.origin)
    seen = np.isfinite(t)
    assert seen.sum() >= 3
    np.testing.assert_allclose(our_t[seen], t[seen], rtol=1e-4)
    np.testing.assert_allclose(our_n[seen], n[seen], atol=5e-3)


def test_instances_and_names_and_what_is_not_used(tmp_path: Path):
    loaded = load_xml(SCENES["foliage"](tmp_path))
    assert loaded.scene.object_names == ("cloth", "ground", "left/rectangle", "left/rectangle 2",
                                         "right/rectangle", "right/rectangle 2")
    assert loaded.scene.max_depth == 16
    assert (loaded.scene.width, loaded.scene.height) == (48, 32)
    assert loaded.unused == ("the film 'hdrfilm' but for its size, the filter 'tent', the sampler "
                             "'independent', the integrator 'path' but for its depth")
    leaves = [s for s in loaded.scene.shapes if s.name.startswith(("left", "right"))]
    assert len({id(shape.material) for shape in leaves}) == 1


def test_the_transform_of_a_group_counts_for_nothing_as_in_mitsuba(tmp_path: Path):
    path = written(tmp_path, scene_xml(
        '<shape type="shapegroup" id="g"><transform name="to_world"><translate x="5"/></transform>'
        '<shape type="cube"/></shape><shape type="instance"><transform name="to_world">'
        '<translate y="2"/></transform><ref id="g"/></shape>' + SKY))
    box = mi.load_file(str(path)).bbox()
    loaded = load_xml(path)
    np.testing.assert_allclose(bounds(loaded.scene.shapes[0]), [box.min, box.max])
    assert "the transform of the shapegroup 'g'" in loaded.unused


def test_an_area_light_may_stand_in_the_scene_and_be_referred_to(tmp_path: Path):
    light = '<emitter type="area" id="light"><rgb name="radiance" value="4, 3, 2"/></emitter>'
    path = written(tmp_path, scene_xml(
        light + BALL.replace("</shape>", '<ref id="light"/></shape>')))
    assert mi.load_file(str(path)).shapes()[0].is_emitter()
    scene = load_xml(path).scene
    assert (scene.shapes[0].emission, scene.lights) == ((4, 3, 2), ())
    with pytest.raises(SceneError, match="of a shape: put it into one, or refer to it there"):
        load_xml(written(tmp_path, scene_xml(BALL + light)))


def test_what_changes_no_picture_is_taken_as_it_is(tmp_path: Path):
    crop = {"crop_offset_x": 0, "crop_offset_y": 0, "crop_width": 24, "crop_height": 16}
    whole = "".join(f'<integer name="{name}" value="{size}"/>' for name, size in crop.items())
    weight = '<float name="silhouette_sampling_weight" value="2"/>'
    shapes = (f'<shape type="shapegroup" id="g"><shape type="cube">{weight}</shape></shape>'
              f'<shape type="instance">{weight}<ref id="g"/></shape>'
              f'<shape type="sphere">{weight}</shape>')
    mi.load_file(str(path := written(tmp_path, scene_xml(shapes + SKY).replace(
        "<rfilter", f"{whole}<rfilter"))))
    scene = load_xml(path).scene
    assert (len(scene.shapes), scene.width, scene.height) == (2, 24, 16)


def test_a_lamp_brighter_than_1_is_no_reason_to_warn(
        tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    pixels = np.random.default_rng(1).uniform(0, 5, (4, 4, 3)).astype(np.float32)
    mi.Bitmap(pixels).write(str(tmp_path / "lamp.exr"))
    path = written(tmp_path, scene_xml(
        GROUND + '<shape type="rectangle"><transform name="to_world"><translate y="1"/></transform>'
        '<emitter type="area"><texture type="bitmap" name="radiance">'
        '<string name="filename" value="lamp.exr"/></texture></emitter></shape>'))
    ours = Renderer(load_xml(path).scene, 16, 24).sample_sum(0, 1, 0, 64, antialias=True) / 64
    assert "WARN" not in "".join(capfd.readouterr())
    theirs = np.array(mi.render(mi.load_file(str(path)), spp=64))[..., :3]
    assert "exceed" in "".join(capfd.readouterr())
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=0.01)


def test_what_is_not_used_is_told_once(tmp_path: Path):
    text = scene_xml(BALL + SKY + '<medium type="homogeneous" id="fog"/>'
                     '<sensor type="perspective"><float name="fov" value="9"/></sensor>',
                     '<float name="fov" value="50"/><float name="near_clip" value="0.1"/>'
                     '<float name="aperture_radius" value="0.1"/>'
                     '<float name="focus_distance" value="4"/>').replace(
        '"perspective">', '"thinlens">', 1).replace(
        '<integrator type="path">', '<integrator type="path"><boolean name="hide_emitters" '
                                    'value="true"/>')
    loaded = load_xml(written(tmp_path, text))
    assert loaded.unused == (
        "the film 'hdrfilm' but for its size, the filter 'box', the lens of the camera, the "
        "camera's clip distances, the integrator 'path' but for its depth (lamps show: "
        "'hide_emitters' too), 1 other sensor")
    assert load_xml(tmp_path / "a.xml", sensor=1).scene.camera.fov == 9


def test_parameters_are_taken_and_without_a_depth_paths_are_long(tmp_path: Path):
    path = SCENES["glass"](tmp_path)
    assert load_xml(path, {"depth": "5"}).scene.max_depth == 5
    assert load_xml(path, {"depth": "-1"}).scene.max_depth == LONGEST_PATH


def test_a_changed_mesh_or_picture_is_another_scene(tmp_path: Path):
    path = SCENES["indoor"](tmp_path)
    first = fingerprint(load_xml(path).scene, [0])
    assert fingerprint(load_xml(path).scene, [0]) == first
    write_png(tmp_path / "wood.png", np.full((8, 8, 3), 0.5))
    second = fingerprint(load_xml(path).scene, [0])
    mesh = tmp_path / "vase.obj"
    mesh.write_text(mesh.read_text().replace("v 0.2", "v 0.21", 1))
    assert len({first, second, fingerprint(load_xml(path).scene, [0])}) == 3


def ply(path: Path, attributes: str, *rows: str) -> None:
    path.write_text(f"""ply\nformat ascii 1.0\nelement vertex 3\nproperty float x
property float y\nproperty float z\n{attributes}element face 1
property list uchar int vertex_indices\nend_header\n""" + "".join(
        f"{i % 2} {i // 2} 0 {row}\n" for i, row in enumerate(rows)) + "3 0 1 2\n")


@pytest.mark.parametrize(("kind", "names", "row", "sentence"), [
    ("float", "rgba", "1 0 0 1", r"line 8, column \d+: this ply cannot be used: its attribute "
                                 "'vertex_color' has rows of 4, and textures show rows of 1 or 3"),
    ("uchar", "rgb", "255 0 0", "1 times the attribute 'vertex_color', holds 255: use 0 to 1"),
    ("float", "rgb", "2e30 0 0", "this ply cannot be used: the values of mesh attribute "
                                "'vertex_color' are not all finite"),
    ("float", ("s_0", "s_1", "s_2"), "1 0 0", "and the mesh of shape 'a' has none")])
def test_colours_of_a_ply_that_cannot_be_shown_are_told(kind: str, names, row: str, sentence: str,
                                                        tmp_path: Path):
    ply(tmp_path / "a.ply", "".join(f"property {kind} {name}\n" for name in names), *[row] * 3)
    path = written(tmp_path, scene_xml(SHAPE.format(
        "ply", f'<string name="filename" value="a.ply"/>{COLORED}')))
    with pytest.raises(SceneError, match=sentence) as caught:
        load_xml(path)
    assert str(caught.value).startswith(f"scene file '{path}', line 8")


def test_data_that_no_material_shows_are_not_of_the_scene(tmp_path: Path):
    """So that a sequence from before they were read goes on."""
    found = []
    for attributes, rows in (("", [""] * 3), ("".join(
            f"property float {name}\n" for name in ("r", "g", "b")), ["0.2 0.3 0.4"] * 3)):
        ply(tmp_path / "a.ply", attributes, *rows)
        for bsdf in ("", COLORED) if attributes else ("",):
            found.append(fingerprint(load_xml(written(tmp_path, scene_xml(SHAPE.format(
                "ply", f'<string name="filename" value="a.ply"/>{bsdf}')))).scene, [0]))
    assert found[0] == found[1] != found[2]


def test_a_shape_of_a_file_may_be_given_a_motion(tmp_path: Path):
    scene = load_xml(written(tmp_path, scene_xml(GROUND + BALL + SKY))).scene
    moving = dataclasses.replace(scene, shapes=tuple(
        dataclasses.replace(s, world_from_object=spin((0, 1, 0), 9) @ s.world_from_object)
        if s.name == "ball" else s for s in scene.shapes))
    assert moving.moving == ("ball",)
    frame = Renderer(moving, 8, 12).frame(1)
    assert not np.array_equal(frame.world_from_object[0], np.diag([0.5, 0.5, 0.5, 1]))


COLORED = ('<bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance">'
           '<string name="name" value="vertex_color"/></texture></bsdf>')
SHAPE = '<shape type="{}">{}</shape>' + SKY


@pytest.mark.parametrize(("text", "sentence"), [
    ("<scene", r"line 1, column 6: it is no XML that can be read"),
    ("", "it is no XML that can be read"),
    ('<bsdf version="3.0.0" type="diffuse"/>', "the file holds a bsdf: give it a <scene>"),
    (scene_xml('<include filename="a.xml"/>'), "files include each other without end"),
    (scene_xml('<include filename="none.xml"/>'), 'included file "none.xml" not found'),
    (scene_xml(SHAPE.format("sphere", '<float name="radius" value="$r"/>')),
     r"line 8, column \d+: the parameter \$r has no value: give it one, as -D r=VALUE"),
    (scene_xml(SHAPE.format("obj", '<string name="filename" value="no.obj"/>')),
     r"line 8, column \d+: this obj names '.*no.obj', and there is no such file"),
    (scene_xml(SHAPE.format("obj", "")), "this obj names no file"),
    (scene_xml(SHAPE.format("obj", '<string name="filename" value="a.xml"/>')),
     "this obj cannot be used: "),
    (scene_xml(SHAPE.format("sphere", '<bsdf type="diffuse"><texture type="bitmap" name='
                            '"reflectance"><string name="filename" value="no.png"/></texture>'
                            "</bsdf>")), r"this bitmap names '.*no.png', and there is no such"),
    (scene_xml(SHAPE.format("sphere", '<bsdf type="diffuse"><texture type="bitmap" name='
                            '"reflectance"><string name="filename" value="a.xml"/></texture>'
                            "</bsdf>")), r"line 8, column \d+: this bitmap names '.*a.xml', "
                                         r"which is no image that can be read"),
    (scene_xml(BALL + '<emitter type="envmap"><string name="filename" value="a.xml"/></emitter>'),
     r"line 8, column \d+: this envmap names '.*a.xml', which is no image that can be read"),
    (scene_xml(SHAPE.format("sphere", '<bsdf type="difuse"/>')),
     "no material of Mitsuba's: did you mean 'diffuse'"),
    (scene_xml(SHAPE.format("sphere", '<bsdf type="diffuse"><float name="gloss" value="1"/></bsdf>'
                            )), r"line 8, column \d+: this diffuse has a property 'gloss'"),
    (scene_xml(SHAPE.format("sphere", '<bsdf type="diffuse"><rgb name="reflectance" value="2"/>'
                            "</bsdf>")), "'reflectance' of this diffuse holds 2: use 0 to 1"),
    (scene_xml(SHAPE.format("sphere", '<bsdf type="hair"/>')), "a hair cannot be rendered here"),
    (scene_xml(SHAPE.format("sphere", '<bsdf type="polarizer"/>')), "nothing of polarisation"),
    (scene_xml(SHAPE.format("sphere", COLORED)),
     r"line 8, column \d+: 'reflectance' of the material of shape 'sphere' is the mesh_attribute "
     "'vertex_color', and shape 'sphere' is no mesh"),
    (scene_xml(SHAPE.format("cube", COLORED)), "and the mesh of shape 'cube' has none: give it"),
    (scene_xml(SHAPE.format("cube", COLORED.replace("vertex_color", "vertex_positions"))),
     "and the mesh of shape 'cube' has none: give it"),
    (scene_xml(SHAPE.format("cube", COLORED.replace("vertex_color", "color"))),
     r"line 8, column \d+: this diffuse is not one that Mitsuba takes: .*attribute name"),
    (scene_xml(SHAPE.format("cube", COLORED.replace('"diffuse"', '"plastic"').replace(
        "reflectance", "diffuse_reflectance"))), "this plastic is not one that Mitsuba takes: "
     ".*textures of data of vertices, such as a mesh_attribute, cannot be there"),
    (scene_xml(SHAPE.format("cube", COLORED.replace('bsdf', 'emitter').replace(
        '"diffuse"', '"area"').replace("reflectance", "radiance"))),
     r"line 8, column \d+: its radiance is a mesh_attribute texture, and lights here cannot"),
    (scene_xml(SHAPE.format("linearcurve", "")), "a shape of type 'linearcurve' cannot be"),
    (scene_xml(SHAPE.format("sphere", '<medium name="interior" type="homogeneous"/>')),
     "media cannot be rendered here, only surfaces"),
    (scene_xml(SHAPE.format("sphere", '<float name="radus" value="1"/>')),
     "a sphere has no property 'radus' here"),
    (scene_xml(SHAPE.format("sphere", '<float name="radius" value="0"/>')), "use more than 0"),
    (scene_xml(SHAPE.format("sphere", '<float name="radius" value="1e400"/>')),
     r"line 8, column \d+: 'radius' of this sphere is inf: use a number of up to 1e\+30"),
    (scene_xml(SHAPE.format("rectangle", '<transform name="to_world"><scale x="0"/></transform>')),
     "flattened by its transform"),
    (scene_xml(SHAPE.format("cylinder", '<transform name="to_world"><scale x="2"/></transform>')),
     "stretched or sheared"),
    (scene_xml(SKY), "there are no shapes"),
    (scene_xml(BALL), "has no light"),
    (scene_xml(BALL + SKY + SKY), "there is another environment"),
    (scene_xml(BALL + '<emitter type="constant"><string name="radiance" value="3"/></emitter>'),
     "what this constant radiates is '3': use a number, an rgb, a spectrum or a texture"),
    (scene_xml(BALL + '<emitter type="projector"/>'), "an emitter of type 'projector' cannot be"),
    ('<scene version="3.0.0">' + BALL + SKY + "</scene>", "there is no camera: add a <sensor>"),
    (scene_xml(BALL + SKY).replace('"perspective"', '"orthographic"'), "of type 'orthographic'"),
    (scene_xml(BALL + SKY, '<float name="fov" value="500"/>'), "field of view is 500.0 degrees"),
    (scene_xml(BALL + SKY).replace("<rfilter", '<integer name="crop_width" value="12"/><rfilter'),
     "a cropped film cannot be rendered here"),
    (scene_xml(BALL + SKY, '<float name="fov" value="50"/><float name="principal_point_offset_x" '
               'value="0.1"/>'), "principal point is off the centre"),
])
def test_what_cannot_be_rendered_is_told_in_one_sentence(text: str, sentence: str, tmp_path: Path):
    path = written(tmp_path, text)
    with pytest.raises(SceneError) as caught:
        load_xml(path)
    said = str(caught.value)
    assert re.search(sentence, said), said
    assert said.startswith("scene file '"), said
    assert "\n" not in said
    assert len(said) < 500


def test_a_file_or_sensor_that_is_not_there(tmp_path: Path):
    with pytest.raises(SceneError, match=r"there is no scene file '.*none.xml'"):
        load_xml(tmp_path / "none.xml")
    path = written(tmp_path, scene_xml(BALL + SKY))
    with pytest.raises(SceneError, match="there is no sensor 1: use --sensor 0"):
        load_xml(path, sensor=1)
    with pytest.raises(SceneError, match=r"has no parameter \$spp: leave out -D spp"):
        load_xml(path, {"spp": "4"})


def test_the_command_renders_goes_on_and_refuses_in_one_line(call, tmp_path: Path):
    path = written(tmp_path, scene_xml(GROUND + BALL + SKY).replace(
        'name="width" value="24"', 'name="width" value="$w"'))
    out, words = tmp_path / "out", ("render", path, "-D", "w=12", "--frames", "0:2")
    moved = ("--camera", "orbit", "--move", "ball=swing")
    done, text, error = call(*words, *moved, "--out", out)
    assert (done, error.count("Traceback")) == (0, 0), error
    assert "of a.xml is not used: the film 'hdrfilm' but for its size, the filter 'box'" in text
    sequence = FrameSequence.open(out)
    assert (sequence.manifest.width, sequence.manifest.max_depth) == (12, 3)
    frames = [sequence.read_frame(i) for i in range(2)]
    for name in ("world_from_object", "camera_from_world"):
        a, b = (getattr(frame, name) for frame in frames)
        assert not np.array_equal(a, b), name
    for wrong, sentence in (
            (words[:2], r"the parameter \$w has no value: give it one, as -D w=VALUE"),
            ((*words, "-D", "h"), "-D h is not understood: use -D NAME=VALUE"),
            ((*words, "-D", "w=9"), "-D w=... is given twice: leave one out"),
            ((*words, *moved, "--move", "ball=spin"), "--move ball=... is given twice"),
            ((*words, "--sensor", 1), "there is no sensor 1: use --sensor 0"),
            (("render", "box", "-D", "w=12"), "-D is for Mitsuba's XML files, and 'box' is none"),
            ((*words, "--camera", "fly"), "there is no camera move 'fly'"),
            ((*words, "--move", "bal=spin"), "no shape 'bal': did you mean 'ball'"),
            ((*words, "--out", out), "holds a sequence with another content")):
        done, _, error = call(*wrong)
        assert done == 2, error
        assert re.search(sentence, error), error
        assert error.count("\n") == 1, error
