"""What studies of many scenes do with each one: render what is missing, make it plain, judge it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from onespp.denoise.catalog import Method
from onespp.denoise.own_method import result_name
from onespp.denoise.score.scorecard import Scores
from onespp.denoise.studies.hard_scenes import Row, judge
from onespp.denoise.studies.suite import Group, groups
from onespp.render.errors import InputError
from onespp.render.files.lock import writing
from onespp.render.files.sequence import FrameSequence
from onespp.render.games202.convert import export_games202, import_games202
from onespp.render.progress import Progress
from onespp.scenes.catalog import GENERATED, HARD_NAMES
from onespp.scenes.generated import KEPT
from onespp.scenes.hard import HARD

from .caller import caller
from .denoising import denoise
from .rendering import render
from .scoring import score

SIZES = {"box": (256, 256), "room": (180, 320), "generated/": (108, 160)}
"""(height, width) of the suite's scenes, by how their names begin."""


def judge_hard(name: str, methods: Mapping[str, Method], folder: Path, reference_spp: int,
               progress: Progress, tell: Callable[[str], None]) -> list[Row]:
    """Render a hard scene into a folder, where it is missing, and try methods on it.

    Args:
        tell: told what to know of its references.

    Raises:
        InputError: the folder holds something else.
    """
    from onespp.render.job import RenderJob, render_sequence  # imports Mitsuba
    from onespp.render.references import reference_notes

    hard = HARD[name]
    scene = hard.make()
    job = RenderJob(scene, range(scene.frames), scene.height, scene.width,
                    reference_spp=reference_spp)
    needed = {channel for method in methods.values() for channel in method.needs}
    job = replace(job, channels=tuple(dict.fromkeys((*job.channel_names(), *sorted(needed)))))
    sequence = render_sequence(job, folder, progress=progress)
    for note in reference_notes(sequence, sequence.frames, reference_spp):
        tell(note)
    return judge(sequence, name, hard.event, hard.diffuse, progress, methods)


def score_suite(method: str, pattern: re.Pattern[str], folder: Path,
                size: tuple[int, int] | None, frames: Sequence[int], reference_spp: int,
                seed: int) -> dict[Group, dict[str, Scores]]:
    """Render, denoise and score the suite's scenes; renders and peers' results are kept.

    Args:
        method: a name, or a file of one's own. pattern: of the names of scenes.
        folder: of all sequences, those of plain frames in its `plain/`.
        size: (height, width) in pixels, default `SIZES`, and the hard scenes' own.

    Returns:
        group -> scene -> scores of the method and the group's peers.

    Raises:
        InputError: no scene has such a name, or a folder holds something else.
    """
    found: dict[Group, dict[str, Scores]] = {}
    asked = groups([GENERATED[i] for i in KEPT], list(HARD_NAMES))
    if not any(pattern.search(scene) for group in asked for scene in group.scenes):
        raise InputError(f"no scene of the suite has '{pattern.pattern}' in its name: `onespp "
                         "scenes` lists them")
    for group in asked:
        scored = found[group] = {}
        for scene in filter(pattern.search, group.scenes):
            pixels = size or next((s for key, s in SIZES.items() if scene.startswith(key)), None)
            sequence = render(scene, folder / scene, frames=frames, size=pixels, seed=seed,
                              reference_spp=reference_spp)
            if group.plain:
                sequence = plain_copy(sequence, folder / "plain" / scene, caller().command())
            for name in without_results(sequence, method, group.peers):
                denoise(sequence, name)
            scored[scene] = score(sequence, dict.fromkeys((result_name(method), *group.peers)))
    return found


def without_results(sequence: FrameSequence, method: str, peers: tuple[str, ...]) -> list[str]:
    """What to denoise by: peers that lack results of some frame, and the method in any case, for
    it is what changes from one time to the next."""
    missing = [peer for peer in peers if peer == method or not all(
        sequence.has_result(peer, i) for i in sequence.frames)]
    return [*missing, *({method} - {*missing})]


def plain_copy(sequence: FrameSequence, folder: Path, command: str = "") -> FrameSequence:
    """The frames exported to the assignment's layout and imported into `folder`, with the
    references of the original; what is there is kept.

    Args:
        command: the command line, for the manifest.
    """
    there = (folder / "manifest.json").exists()
    if not there or not all(map((kept := FrameSequence.open(folder)).has_frame, kept.frames)):
        files = sequence.folder / "games202"
        export_games202(sequence, files)
        with writing(folder, "render", alone=there):
            import_games202(files, folder, fps=sequence.manifest.fps, overwrite=there,
                            command=command)
    plain = FrameSequence.open(folder)
    for k, i in zip(plain.frames, sequence.frames, strict=True):
        if not plain.has_reference(k):
            plain.write_reference(k, sequence.read_reference(i))
    return plain.with_reference_spp()
