"""Mitsuba XML scenes of the plugin mix of those that people use most, written by code.

Each function writes a file with its meshes and images into a folder and returns its path. Pictures
are 48x32; what is tiny in them stands for what is large in the scenes that they are like.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from onespp.scenes import meshes
from onespp.scenes.description import Mesh

HEAD = """<scene version="3.0.0">
  <default name="depth" value="{depth}"/><default name="filter" value="tent"/>
  <integrator type="path"><integer name="max_depth" value="$depth"/></integrator>
  <sensor type="perspective">
    {fov}
    <transform name="to_world">
      <lookat origin="{origin}" target="{target}" up="0, 1, 0"/></transform>
    <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
    <film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="32"/>
      <rfilter type="$filter"/></film>
  </sensor>
"""


def indoor(folder: Path) -> Path:
    """A room of several OBJ and PLY meshes with bitmaps, bumps, and two area lights."""
    write_obj(folder / "walls.obj", _room())
    write_obj(folder / "table.obj", meshes.box((1.2, 0.1, 0.8)))
    write_obj(folder / "vase.obj", meshes.lathe([(0.0, 0), (0.2, 0), (0.1, 0.3), (0.2, 0.5)], 12))
    write_ply(folder / "block.ply", meshes.box((0.4, 0.4, 0.4)))
    write_png(folder / "wood.png", _stripes((0.6, 0.4, 0.2), (0.3, 0.2, 0.1)))
    write_png(folder / "bumps.png", _stripes((0.1, 0.1, 0.1), (0.9, 0.9, 0.9)))
    path = folder / "indoor.xml"
    path.write_text(HEAD.format(depth=7, origin="0, 1.2, 3.4", target="0, 0.9, 0",
                                fov='<float name="fov" value="60"/>') + """
  <bsdf type="twosided" id="wall"><bsdf type="diffuse">
    <rgb name="reflectance" value="0.7, 0.65, 0.6"/></bsdf></bsdf>
  <bsdf type="twosided" id="wood"><bsdf type="bumpmap">
    <texture type="bitmap"><string name="filename" value="bumps.png"/>
      <boolean name="raw" value="true"/></texture>
    <float name="scale" value="0.02"/>
    <bsdf type="roughplastic"><float name="alpha" value="0.2"/>
      <texture name="diffuse_reflectance" type="bitmap">
        <string name="filename" value="wood.png"/>
        <transform name="to_uv"><scale x="2" y="2"/></transform></texture></bsdf></bsdf></bsdf>
  <bsdf type="twosided" id="steel"><bsdf type="roughconductor">
    <string name="material" value="Al"/><float name="alpha" value="0.25"/></bsdf></bsdf>
  <shape type="obj" id="walls"><string name="filename" value="walls.obj"/><ref id="wall"/></shape>
  <shape type="obj"><string name="filename" value="table.obj"/>
    <transform name="to_world"><translate y="0.5"/></transform><ref id="wood"/></shape>
  <shape type="obj"><string name="filename" value="vase.obj"/>
    <transform name="to_world"><scale x="1" y="1.3" z="0.8"/>
      <translate x="0.3" y="0.55"/></transform>
    <ref id="steel"/></shape>
  <shape type="ply"><string name="filename" value="block.ply"/>
    <boolean name="face_normals" value="true"/>
    <transform name="to_world"><scale x="-1"/><rotate y="1" angle="30"/>
      <translate x="-0.4" y="0.75"/></transform>
    <bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.1, 0.3, 0.6"/></bsdf></shape>
  <shape type="rectangle" id="lamp">
    <transform name="to_world"><scale x="0.5" y="0.3"/><rotate x="1" angle="90"/>
      <translate y="2.38"/></transform>
    <emitter type="area"><rgb name="radiance" value="18, 16, 12"/>
      <float name="sampling_weight" value="2"/></emitter></shape>
  <shape type="sphere"><point name="center" x="-1.2" y="1.6" z="0.3"/>
    <float name="radius" value="0.15"/>
    <emitter type="area"><spectrum name="radiance" value="14"/></emitter></shape>
</scene>
""")
    return path


def glass(folder: Path) -> Path:
    """Clear, thin and rough dielectrics and metal, boxes and tubes, a lamp with a picture."""
    write_png(folder / "lamp.png", _stripes((0.2, 0.5, 0.9), (0.9, 0.6, 0.3)))
    write_obj(folder / "block.obj", meshes.box((0.8, 0.8, 0.8)), normals=False)
    path = folder / "glass.xml"
    path.write_text(HEAD.format(depth=12, origin="0.5, 1.6, 4", target="0, 0.5, 0",
                                fov='<string name="focal_length" value="45mm"/>') + """
  <bsdf type="roughconductor" id="gold"><string name="material" value="Au"/>
    <string name="distribution" value="ggx"/><float name="alpha" value="0.2"/></bsdf>
  <shape type="rectangle"><transform name="to_world"><scale value="5"/>
      <rotate x="1" angle="-90"/></transform>
    <bsdf type="diffuse"><texture name="reflectance" type="checkerboard">
      <rgb name="color0" value="0.2"/><rgb name="color1" value="0.7, 0.6, 0.5"/>
      <transform name="to_uv"><scale x="6" y="6"/></transform></texture></bsdf></shape>
  <shape type="sphere"><float name="radius" value="0.5"/>
    <transform name="to_world"><translate x="-0.9" y="0.5" z="0.3"/></transform>
    <bsdf type="roughdielectric"><float name="alpha" value="0.3"/>
      <string name="int_ior" value="bk7"/></bsdf></shape>
  <shape type="obj"><string name="filename" value="block.obj"/>
    <boolean name="face_normals" value="true"/>
    <transform name="to_world"><rotate y="1" angle="25"/><translate x="0.6" y="0.4"/></transform>
    <bsdf type="roughdielectric"><float name="alpha" value="0.15"/></bsdf></shape>
  <shape type="cylinder"><point name="p0" x="-0.2" y="0" z="-0.8"/>
    <point name="p1" x="-0.2" y="1.4" z="-0.8"/><float name="radius" value="0.25"/>
    <ref id="gold"/></shape>
  <shape type="cube"><transform name="to_world"><scale x="0.02" y="0.5" z="0.4"/>
      <translate x="-0.2" y="0.52" z="1"/></transform>
    <bsdf type="thindielectric"/></shape>
  <shape type="rectangle"><boolean name="flip_normals" value="true"/>
    <transform name="to_world"><scale value="1.5"/><rotate x="1" angle="-90"/>
      <translate y="3.5"/></transform>
    <emitter type="area"><texture name="radiance" type="bitmap">
      <string name="filename" value="lamp.png"/></texture></emitter></shape>
  <emitter type="constant"><rgb name="radiance" value="0.4, 0.45, 0.5"/></emitter>
</scene>
""")
    return path


def foliage(folder: Path) -> Path:
    """Masked quads of one group, instanced, under a turned environment map."""
    alpha = np.zeros((8, 8, 3))
    alpha[2:6, 1:7] = 1
    write_png(folder / "leaf.png", alpha)
    from onespp.render.mitsuba.variant import mi
    sky = np.ones((4, 8, 3), np.float32) * (0.4, 0.6, 1.0)
    sky[1, 2] = 6, 5, 4
    mi.Bitmap(sky.astype(np.float32)).write(str(folder / "sky.exr"))
    path = folder / "foliage.xml"
    path.write_text(HEAD.format(depth=16, origin="0, 1, 4", target="0, 0.8, 0",
                                fov='<float name="fov" value="35"/>'
                                    '<string name="fov_axis" value="y"/>') + """
  <bsdf type="mask" id="leaf">
    <texture name="opacity" type="bitmap"><string name="filename" value="leaf.png"/>
      <boolean name="raw" value="true"/></texture>
    <bsdf type="twosided"><bsdf type="diffuse">
      <rgb name="reflectance" value="0.2, 0.5, 0.1"/></bsdf></bsdf></bsdf>
  <bsdf type="mask" id="veil"><float name="opacity" value="0.4"/>
    <bsdf type="twosided"><bsdf type="principled"><rgb name="base_color" value="0.7, 0.2, 0.2"/>
      <float name="roughness" value="0.5"/></bsdf></bsdf></bsdf>
  <shape type="shapegroup" id="twig">
    <shape type="rectangle"><transform name="to_world"><scale value="0.4"/>
      <rotate x="1" angle="-35"/></transform><ref id="leaf"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.3"/>
      <rotate y="1" angle="60"/><translate x="0.3" y="0.3"/></transform><ref id="leaf"/></shape>
  </shape>
  <shape type="instance" id="left"><ref id="twig"/>
    <transform name="to_world"><translate x="-0.6" y="0.7"/></transform></shape>
  <shape type="instance" id="right"><ref id="twig"/>
    <transform name="to_world"><rotate y="1" angle="40"/><scale value="1.4"/>
      <translate x="0.6" y="0.9" z="-0.5"/></transform></shape>
  <shape type="disk" id="veil"><transform name="to_world"><scale x="0.5" y="0.8"/>
      <translate y="0.9" z="0.8"/></transform><ref id="veil"/></shape>
  <shape type="rectangle" id="ground"><transform name="to_world"><scale value="6"/>
      <rotate x="1" angle="-90"/></transform>
    <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
  <emitter type="envmap"><string name="filename" value="sky.exr"/>
    <float name="scale" value="0.8"/>
    <transform name="to_world"><rotate y="1" angle="70"/></transform></emitter>
</scene>
""".replace('id="veil"><transform', 'id="cloth"><transform'))
    return path


def many(folder: Path) -> Path:
    """774 shapes of a few meshes and materials, long paths, one lamp: as a staircase or a city."""
    write_obj(folder / "block.obj", meshes.box((0.16, 0.16, 0.16)))
    write_obj(folder / "cup.obj", meshes.lathe([(0.0, 0), (0.08, 0), (0.05, 0.2)], 8))
    rng = np.random.default_rng(5)
    kinds = ("clay", "plastic", "brass")
    shapes = []
    for i in range(771):
        row, column = divmod(i, 31)
        x, z, turn = 0.25 * (column - 15), 0.25 * (row - 18), rng.uniform(0, 90)
        shapes.append(
            f'<shape type="obj" id="thing {i}"><string name="filename" '
            f'value="{"cup" if i % 3 else "block"}.obj"/><transform name="to_world">'
            f'<rotate y="1" angle="{turn:.1f}"/><scale y="{rng.uniform(0.5, 3):.2f}"/>'
            f'<translate x="{x:.2f}" y="0.1" z="{z:.2f}"/></transform>'
            f'<ref id="{kinds[i % len(kinds)]}"/></shape>')
    path = folder / "many.xml"
    path.write_text(HEAD.format(depth=65, origin="0, 2.2, 4", target="0, 0, 0",
                                fov='<float name="fov" value="50"/>') + """
  <bsdf type="twosided" id="clay"><bsdf type="diffuse">
    <rgb name="reflectance" value="0.7, 0.5, 0.4"/></bsdf></bsdf>
  <bsdf type="twosided" id="plastic"><bsdf type="roughplastic"><float name="alpha" value="0.2"/>
    <rgb name="diffuse_reflectance" value="0.2, 0.3, 0.6"/></bsdf></bsdf>
  <bsdf type="twosided" id="brass"><bsdf type="roughconductor"><float name="alpha" value="0.3"/>
    <rgb name="specular_reflectance" value="0.9, 0.7, 0.4"/></bsdf></bsdf>
""" + "\n".join(shapes) + """
  <shape type="rectangle" id="ground"><transform name="to_world"><scale value="6"/>
      <rotate x="1" angle="-90"/></transform><ref id="clay"/></shape>
  <shape type="rectangle" id="ceiling"><transform name="to_world"><scale value="6"/>
      <rotate x="1" angle="90"/><translate y="4.2"/></transform><ref id="clay"/></shape>
  <shape type="rectangle" id="lamp"><transform name="to_world"><scale x="2" y="1.5"/>
      <rotate x="1" angle="90"/><translate y="4"/></transform>
    <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>
</scene>
""")
    return path


def lights(folder: Path) -> Path:
    """Lights of all kinds, more than eight, with instances and stretched and mirrored spheres."""
    path = folder / "lights.xml"
    lamps = "".join(
        f'<shape type="sphere" id="bulb {i}"><point name="center" x="{-1.5 + i}" y="2.2" '
        f'z="{0.4 * (i % 2) - 1}"/><float name="radius" value="0.1"/><emitter type="area">'
        f'<rgb name="radiance" value="{6 + i}, 7, {9 - i}"/></emitter></shape>' for i in range(4))
    path.write_text(HEAD.format(depth=6, origin="0.5, 1.6, 4", target="0, 0.6, 0",
                                fov='<float name="fov" value="50"/>') + lamps + """
  <shape type="shapegroup" id="pair">
    <shape type="sphere"><float name="radius" value="0.3"/>
      <bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.6, 0.2, 0.2"/></bsdf></shape>
    <shape type="cube"><transform name="to_world"><scale value="0.2"/><translate y="0.5"/>
      </transform><bsdf type="diffuse"/></shape>
  </shape>
  <shape type="instance" id="near"><ref id="pair"/><transform name="to_world">
      <translate x="-0.9" y="0.3" z="0.5"/></transform></shape>
  <shape type="instance" id="far"><ref id="pair"/><transform name="to_world">
      <scale value="1.3"/><rotate y="1" angle="30"/><translate x="0.9" y="0.4" z="-0.6"/>
      </transform></shape>
  <shape type="sphere" id="mirrored"><float name="radius" value="0.4"/>
    <transform name="to_world"><scale x="-1"/><rotate z="1" angle="20"/>
      <translate x="0.1" y="0.4" z="0.2"/></transform>
    <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.3, 0.6, 0.3"/>
      </bsdf></bsdf></shape>
  <shape type="rectangle" id="ground"><transform name="to_world"><scale value="4"/>
      <rotate x="1" angle="-90"/></transform>
    <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
  <shape type="disk" id="panel"><transform name="to_world"><scale value="0.4"/>
      <rotate y="1" angle="70"/><translate x="-2" y="1" z="0"/></transform>
    <emitter type="area"><rgb name="radiance" value="5, 5, 8"/></emitter></shape>
  <emitter type="point"><point name="position" value="1.5, 1.8, 1"/>
    <rgb name="intensity" value="1.5, 1.2, 1"/></emitter>
  <emitter type="point"><point name="position" value="-1.2, 2, -1"/>
    <rgb name="intensity" value="0.5, 1, 1.5"/></emitter>
  <emitter type="spot"><rgb name="intensity" value="8, 8, 5"/>
    <float name="cutoff_angle" value="25"/><transform name="to_world">
      <lookat origin="0, 3, 2" target="0, 0, 0" up="1, 0, 0"/></transform></emitter>
  <emitter type="directional"><vector name="direction" value="-1, -2, -0.5"/>
    <rgb name="irradiance" value="0.5, 0.5, 0.6"/></emitter>
  <emitter type="constant"><rgb name="radiance" value="0.1, 0.1, 0.15"/></emitter>
</scene>
""")
    return path


def metals(folder: Path) -> Path:
    """Conductors, maps of bumps and normals, blends, two sides that differ, under a turned sky."""
    from onespp.render.mitsuba.variant import mi
    sky = np.ones((8, 16, 3), np.float32) * (0.5, 0.6, 0.8)
    sky[:4, 3:6] = 3, 2.5, 2
    mi.Bitmap(sky.astype(np.float32)).write(str(folder / "sky.exr"))
    write_png(folder / "bumps.png", _stripes((0.1, 0.1, 0.1), (0.9, 0.9, 0.9)))
    write_png(folder / "normals.png", _stripes((0.4, 0.5, 0.97), (0.6, 0.45, 0.98)))
    write_obj(folder / "vase.obj", meshes.lathe([(0.0, 0), (0.4, 0), (0.2, 0.6), (0.4, 1)], 12))
    path = folder / "metals.xml"
    path.write_text(HEAD.format(depth=10, origin="0, 1.3, 4", target="0, 0.5, 0",
                                fov='<float name="fov" value="45"/>') + """
  <bsdf type="twosided" id="copper"><bsdf type="bumpmap">
    <texture type="bitmap"><string name="filename" value="bumps.png"/>
      <boolean name="raw" value="true"/></texture><float name="scale" value="0.03"/>
    <bsdf type="roughconductor"><string name="material" value="Cu"/>
      <float name="alpha" value="0.3"/></bsdf></bsdf></bsdf>
  <bsdf type="twosided" id="tile"><bsdf type="normalmap">
    <texture name="normalmap" type="bitmap"><string name="filename" value="normals.png"/>
      <boolean name="raw" value="true"/>
      <transform name="to_uv"><scale x="4" y="4"/></transform></texture>
    <bsdf type="roughplastic"><float name="alpha" value="0.25"/>
      <rgb name="diffuse_reflectance" value="0.5, 0.4, 0.3"/></bsdf></bsdf></bsdf>
  <bsdf type="twosided" id="worn"><bsdf type="blendbsdf">
    <texture name="weight" type="bitmap"><string name="filename" value="bumps.png"/>
      <boolean name="raw" value="true"/></texture>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.1, 0.1"/></bsdf>
    <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></bsdf></bsdf>
  <bsdf type="twosided" id="card">
    <bsdf type="diffuse"><rgb name="reflectance" value="0.1, 0.3, 0.7"/></bsdf>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.6, 0.1"/></bsdf></bsdf>
  <shape type="obj" id="vase"><string name="filename" value="vase.obj"/><transform name="to_world">
      <translate x="-1" z="0.2"/></transform><ref id="copper"/></shape>
  <shape type="sphere" id="ball"><point name="center" x="0.2" y="0.5" z="0.4"/>
    <float name="radius" value="0.5"/><ref id="worn"/></shape>
  <shape type="sphere" id="chrome"><point name="center" x="1.2" y="0.4" z="-0.3"/>
    <float name="radius" value="0.4"/><bsdf type="conductor"/></shape>
  <shape type="rectangle" id="sheet"><transform name="to_world"><scale value="0.5"/>
      <rotate y="1" angle="150"/><translate x="0.1" y="1.1" z="-0.8"/></transform>
    <ref id="card"/></shape>
  <shape type="rectangle" id="ground"><transform name="to_world"><scale value="5"/>
      <rotate x="1" angle="-90"/></transform><ref id="tile"/></shape>
  <emitter type="envmap"><string name="filename" value="sky.exr"/>
    <transform name="to_world"><rotate y="1" angle="200"/></transform></emitter>
</scene>
""")
    return path


def painted(folder: Path) -> Path:
    """PLY meshes with colours of vertices and of faces, and with a roughness of vertices."""
    rng = np.random.default_rng(5)
    ball, block = meshes.ellipsoid((0.5, 0.5, 0.5), 16), meshes.box((0.7, 0.7, 0.7))
    write_ply(folder / "ball.ply", replace(ball, attributes={
        "vertex_color": rng.uniform(0.05, 0.95, (len(ball.vertices), 3)),
        "vertex_rough": rng.uniform(0.1, 0.5, (len(ball.vertices), 1))}))
    write_ply(folder / "block.ply", replace(block, attributes={
        "face_color": rng.uniform(0.05, 0.95, (len(block.faces), 3))}))
    path = folder / "painted.xml"
    path.write_text(HEAD.format(depth=5, origin="0.4, 1.6, 3.2", target="0, 0.5, 0",
                                fov='<float name="fov" value="45"/>') + """
  <bsdf type="diffuse" id="faces"><texture type="mesh_attribute" name="reflectance">
    <string name="name" value="face_color"/></texture></bsdf>
  <shape type="ply" id="ball"><string name="filename" value="ball.ply"/>
    <transform name="to_world"><scale x="-1"/><translate x="-0.6" y="0.5"/></transform>
    <bsdf type="twosided"><bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance">
      <string name="name" value="vertex_color"/><float name="scale" value="0.8"/></texture>
    </bsdf></bsdf></shape>
  <shape type="ply" id="block"><string name="filename" value="block.ply"/>
    <boolean name="face_normals" value="true"/><ref id="faces"/>
    <transform name="to_world"><rotate y="1" angle="35"/><translate x="0.7" y="0.35"/></transform>
  </shape>
  <shape type="ply" id="metal"><string name="filename" value="ball.ply"/>
    <transform name="to_world"><translate x="0.1" y="0.5" z="-1"/></transform>
    <bsdf type="roughconductor"><string name="distribution" value="ggx"/>
      <texture type="mesh_attribute" name="alpha">
        <string name="name" value="vertex_rough"/></texture>
      <texture type="mesh_attribute" name="specular_reflectance">
        <string name="name" value="vertex_color"/></texture></bsdf></shape>
  <shape type="shapegroup" id="small"><shape type="ply">
    <string name="filename" value="block.ply"/><boolean name="flip_normals" value="true"/>
    <bsdf type="twosided"><ref id="faces"/></bsdf></shape></shape>
  <shape type="instance"><ref id="small"/><transform name="to_world"><scale value="0.4"/>
    <translate x="-0.2" y="0.14" z="0.9"/></transform></shape>
  <shape type="rectangle" id="ground"><transform name="to_world"><scale value="4"/>
    <rotate x="1" angle="-90"/></transform></shape>
  <shape type="rectangle" id="lamp"><transform name="to_world"><rotate x="1" angle="90"/>
      <translate y="3"/></transform>
    <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>
  <emitter type="constant"><rgb name="radiance" value="0.2"/></emitter>
</scene>
""")
    return path


SCENES = {"indoor": indoor, "glass": glass, "foliage": foliage, "many": many, "lights": lights,
          "metals": metals}


def _room() -> Mesh:
    """A box seen from inside, without its front."""
    whole = meshes.box((4, 2.4, 4))
    keep = ~(whole.vertices[whole.faces][:, :, 2] > 1.9).all(1)
    assert whole.normals is not None
    return Mesh(whole.vertices + np.array((0, 1.2, 0)), whole.faces[keep][:, ::-1], -whole.normals,
                whole.uv)


def _stripes(a: tuple[float, ...], b: tuple[float, ...]) -> np.ndarray:
    pixels = np.empty((8, 8, 3))
    pixels[:, ::2], pixels[:, 1::2] = a, b
    return pixels


def write_png(path: Path, pixels: np.ndarray) -> None:
    from onespp.render.mitsuba.variant import mi
    mi.Bitmap(np.round(pixels * 255).astype(np.uint8)).write(str(path))


def write_obj(path: Path, mesh: Mesh, normals: bool = True) -> None:
    assert mesh.uv is not None
    assert mesh.normals is not None
    corner = "{0}/{0}/{0}" if normals else "{0}/{0}"
    path.write_text("\n".join([
        *(f"v {x} {y} {z}" for x, y, z in mesh.vertices), *(f"vt {u} {v}" for u, v in mesh.uv),
        *(f"vn {x} {y} {z}" for x, y, z in mesh.normals if normals),
        *("f " + " ".join(corner.format(i + 1) for i in face) for face in mesh.faces), ""]))


def write_quad(path: Path, uv: int = 1) -> None:
    """The square [-1, 1]^2 as an OBJ whose picture lies as on a rectangle, once, or uv^2 times."""
    path.write_text("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n"
                    f"vt 0 {uv}\nvt {uv} {uv}\nvt {uv} 0\nvt 0 0\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n")


def write_ply(path: Path, mesh: Mesh) -> None:
    """With its attributes, called as Mitsuba does: what is `vertex_color` there is r, g and b."""
    names: dict[str, list[str]] = {"vertex": [], "face": []}
    rows = {"vertex": [mesh.vertices], "face": [np.full((len(mesh.faces), 1), 3), mesh.faces]}
    for name, values in mesh.attributes.items():
        kind, _, word = name.partition("_")
        rows[kind].append(values)
        names[kind] += [f"property float {part}" for part in (
            "rgb" if word == "color" else [f"{word}_{i}" for i in range(values.shape[1])])]
    path.write_text("\n".join([
        "ply", "format ascii 1.0", f"element vertex {len(mesh.vertices)}",
        *(f"property float {axis}" for axis in "xyz"), *names["vertex"],
        f"element face {len(mesh.faces)}", "property list uchar int vertex_indices",
        *names["face"], "end_header",
        *(" ".join(f"{x}" for part in row for x in part) for kind in ("vertex", "face")
          for row in zip(*rows[kind])), ""]))
