"""The command `scenes`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from onespp.render.cli.figures import json_option, show_or_print

if TYPE_CHECKING:
    from onespp.scenes.description import Scene


@click.command()
@json_option
def scenes(json_to: str | None) -> None:
    """List the scenes: frames, size, what moves."""
    from onespp.scenes import catalog
    from onespp.scenes.description import SceneError

    made = {name: catalog.load(name) for name in catalog.names()}
    packages, broken = {}, {}
    for offer in catalog.offers():
        try:
            made[offer.name] = catalog.load(offer.name)
            packages[offer.name] = f"{offer.package} {offer.version}"
        except SceneError as error:  # one broken package does not keep the others from view
            broken[offer.name] = str(error)

    def show() -> None:
        for name in (*catalog.SCENES, *packages):
            _show(name, made[name])
            if name in packages:
                click.echo(f"    of the package {packages[name]}")
        for name, error in broken.items():
            click.echo(f"{name}: not usable, {error}")
        click.echo("\nSmall scenes that each isolate one failure; `onespp hard` tries methods on "
                   "them:")
        for name in catalog.HARD_NAMES:
            scene = made[name]
            click.echo(f"    {scene.name}: {scene.about}")
        click.echo("\nScenes drawn from a seed; the second half is kept to check with:")
        for name in catalog.GENERATED:
            click.echo(f"    {name}: {made[name].about}")

    show_or_print({name: {
        "about": scene.about, "frames": scene.frames, "width": scene.width, "height": scene.height,
        "fps": scene.fps, "shapes": len(scene.shapes), "max_depth": scene.max_depth,
        "moving": list(scene.moving), "package": packages.get(name)}
        for name, scene in made.items()}, json_to, show)


def _show(name: str, scene: Scene) -> None:
    click.echo(f"{name}: {scene.about}\n"
               f"    {scene.frames} frames of {scene.width}x{scene.height} at {scene.fps} fps, "
               f"{len(scene.shapes)} shapes, paths of up to {scene.max_depth} segments\n"
               f"    moves: {', '.join(scene.moving) or 'nothing'}")
