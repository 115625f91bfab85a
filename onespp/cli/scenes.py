"""The command `scenes`."""

from __future__ import annotations

import click


@click.command()
def scenes() -> None:
    """List the scenes: frames, size, what moves."""
    from onespp.scenes import catalog
    from onespp.scenes.hard import HARD

    for name in catalog.SCENES:
        scene = catalog.load(name)
        click.echo(f"{name}: {scene.about}\n"
                   f"    {scene.frames} frames of {scene.width}x{scene.height} at {scene.fps} fps, "
                   f"{len(scene.shapes)} shapes, paths of up to {scene.max_depth} segments\n"
                   f"    moves: {', '.join(scene.moving) or 'nothing'}")
    click.echo("\nSmall scenes that each isolate one failure; `onespp hard` tries methods on them:")
    for hard_one in HARD.values():
        scene = hard_one.make()
        click.echo(f"    {scene.name}: {scene.about}")
    click.echo("\nScenes drawn from a seed; the second half is kept to check with:")
    for name in catalog.GENERATED:
        click.echo(f"    {name}: {catalog.load(name).about}")
