"""Scenes drawn from a seed: pure functions of a number, each of other lights, surfaces and motions.

Twenty-four have names, `generated/0` to `generated/23`. The first twelve, `DEVELOP`, are there to
develop on. The last twelve, `KEPT`, are kept to check with: never look for a parameter on them, nor
for the cause of a loss; whoever does has to draw others (from 24 on) and keep those.

In each half every kind of place, light and camera occurs (see `plan.py`); what stands where, of
which surface, how it moves and what shines how much is drawn. Metres, y up, the ground at y = 0;
the camera looks from +z at things around the origin. Lights are scaled so that a picture is
neither dark nor blown, by an estimate without rendering (see `exposure.py`).
"""

from __future__ import annotations

from onespp.scenes.description import Scene, SceneError

from . import exposure, lights, objects, stages, views
from .plan import KEPT_FROM, plan

COUNT = 2 * KEPT_FROM
DEVELOP, KEPT = range(KEPT_FROM), range(KEPT_FROM, COUNT)
FRAMES, WIDTH, HEIGHT = 20, 480, 324


def generated(number: int) -> Scene:
    """Scene `number`, 0 or more.

    Raises:
        SceneError: a number below 0.
    """
    if number < 0:
        raise SceneError(f"there is no generated scene {number}: use 0 or more")
    draft = plan(number)
    stage = stages.stage(draft)
    things, free = objects.things(draft)
    rig = exposure.exposed(lights.rig(draft, stage, free), stage, FRAMES)
    shapes = (*stage.shapes, *things, *(lamp.shape() for lamp in rig.lamps))
    return Scene(
        name=f"generated/{number}",
        about=f"{draft.place}, light: {draft.light}, camera: {draft.camera}, "
              f"{len(rig.lamps)} lamps, {len(things)} things",
        shapes=shapes, camera=views.camera(draft), frames=FRAMES, width=WIDTH, height=HEIGHT,
        max_depth=7, environment=rig.sky)
