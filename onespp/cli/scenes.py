"""The command `scenes`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from onespp.scenes.description import Scene


@click.command()
def scenes() -> None:
    """List the scenes: frames, size, what moves."""
    from onespp.scenes import catalog
    from onespp.scenes.description import SceneError
    from onespp.scenes.hard import HARD

    for name in catalog.SCENES:
        _show(name, catalog.load(name))
    for offer in catalog.offers():
        try:
            _show(offer.name, catalog.load(offer.name))
            click.echo(f"    of the package {offer.package} {offer.version}")
        except SceneError as error:  # one broken package does not keep the others from view
            click.echo(f"{offer.name}: not usable, {error}")
    click.echo("\nSmall scenes that each isolate one failure; `onespp hard` tries methods on them:")
    for hard_one in HARD.values():
        scene = hard_one.make()
        click.echo(f"    {scene.name}: {scene.about}")
    click.echo("\nScenes drawn from a seed; the second half is kept to check with:")
    for name in catalog.GENERATED:
        click.echo(f"    {name}: {catalog.load(name).about}")


def _show(name: str, scene: Scene) -> None:
    click.echo(f"{name}: {scene.about}\n"
               f"    {scene.frames} frames of {scene.width}x{scene.height} at {scene.fps} fps, "
               f"{len(scene.shapes)} shapes, paths of up to {scene.max_depth} segments\n"
               f"    moves: {', '.join(scene.moving) or 'nothing'}")
