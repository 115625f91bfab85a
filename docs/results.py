"""Prints the tables of README.md and of two pages of the docs, or writes them there (`--write`).

    python docs/results.py                         # an hour on two cores
    python docs/results.py --frames 0:2 --box-size 48x48 --room-size 48x27 --reference-spp 16 \\
        --parts scores --data build/tiny           # a minute, to see that it works

Each part is a block `<!-- results:NAME -->` ... `<!-- /results -->` in one of the files. A part
renders what it needs, denoises and scores it by the library, and says what its numbers stand on:
frames, size, samples of the reference, seed, tone map, the input's own score. What is quadratic is
by halves of the reference, and has no floor but a standard error (±).

It can be stopped and started again: renders and references resume, results of the same parameters
are kept. After a change of a method, `--again` denoises anew.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path

import click
import failures
import from_code
import numpy as np

import onespp  # noqa: F401 - finds LLVM before anything imports Dr.Jit
from onespp.api.studies import plain_copy
from onespp.denoise.catalog import METHODS, PEERS, Method, build, parameters
from onespp.denoise.metrics.tonemap import TONE_MAP
from onespp.denoise.report.speed_error_plot import plot_speed_against_error
from onespp.denoise.run.interleaved_timing import time_methods
from onespp.denoise.run.sequence import denoise_sequence
from onespp.denoise.score.method_score import INPUT, MethodScore
from onespp.denoise.score.scorecard import Scores
from onespp.denoise.score.sequence import score
from onespp.denoise.studies import hard_scenes as hard_study
from onespp.denoise.studies import suite as suite_study
from onespp.denoise.studies.ablation import ablate, variants
from onespp.denoise.studies.ablation import markdown as ablation_table
from onespp.denoise.studies.lead import BEST as BEST_FORM
from onespp.denoise.studies.lead import OIDN_FORMS, peer_in, psnr_of
from onespp.denoise.studies.lead import markdown as lead_table
from onespp.render.channels import REPLAY
from onespp.render.cli.arguments import parse_size
from onespp.render.cli.options import use
from onespp.render.cli.terminal import run as run_command
from onespp.render.errors import InputError
from onespp.render.files.atomic import write_bytes
from onespp.render.files.frame_ranges import format_frames, parse_frames
from onespp.render.files.lock import writing
from onespp.render.files.sequence import FrameSequence
from onespp.render.files.times import read_times
from onespp.render.job import RenderJob, render_sequence
from onespp.scenes import catalog
from onespp.scenes.generated import KEPT
from onespp.scenes.hard import HARD

ROOT = Path(__file__).resolve().parents[1]
PLAIN, OURS = ("mis", "pcg"), ("resampled", "zsobol")  # --direct and --sampler
SUMMARY = (INPUT, "atrous", "svgf", "oidn-high", "temporal-oidn-split", "onespp")
BEST, PEER, RATIO_TO = "onespp", "oidn-high", "oidn-fast"
STRONGEST = "temporal-oidn-split"  # form of the peer: on our own signals, accumulated
NOT_PLOTTED = ("oidn-balanced", "temporal-oidn")  # where names would lie over one another
LIGHT_FRAMES, LIGHT_SIZE = "0:8", "160x108"  # of the kept scenes of all kinds of light
OTHERS = {  # label -> scene, frames, size, seed: scenes and frames that nothing was tuned on
    "`docs/slow_box.py`: a quarter of the pace": ("docs/slow_box.py", "0:16", "128x128", 5),
    "`box`, frames 60:92:2: twice the pace": ("box", "60:92:2", "128x128", 5),
    "`room`, frames 40:72:4: four times the pace, moving camera": (
        "room", "40:72:4", "160x90", 5),
    "`docs/swinging_lamp.py`: a light that moves and changes colour, an orbiting camera": (
        "docs/swinging_lamp.py", "0:16", "128x128", 5),
}


@dataclass(frozen=True)
class Plan:
    """What to render, and where it lies.

    Attributes:
        frames: as `--frames` of `onespp render`. sizes: scene -> WxH. spp: of the references of
            the two scenes; others_spp, hard_spp: of the other scenes' and the hard ones'.
        seed: of the two scenes. hard: names of hard scenes. data: folder of the sequences.
        again: denoise anew what has results already.
    """

    frames: str
    sizes: Mapping[str, str]
    spp: int
    others_spp: int
    hard_spp: int
    seed: int
    hard: tuple[str, ...]
    data: Path
    again: bool

    @cached_property
    def pairs(self) -> dict[str, tuple[Scores, Scores]]:
        """Scene -> scores on the plain input, and on ours."""
        return {scene: (self.scored(scene, plain=True), self.ours[scene]) for scene in self.sizes}

    @cached_property
    def ours(self) -> dict[str, Scores]:
        """Scene -> scores on our input, with times in turns."""
        return {scene: self.scored(scene) for scene in self.sizes}

    def scored(self, scene: str, plain: bool = False) -> Scores:
        """Scores of all methods on one of the two scenes; on ours, with times in turns."""
        sequence = self.sequence(scene, plain)
        methods = all_methods(sequence)
        denoise(sequence, methods, self.again)
        if not plain and (self.again or not timed(sequence, methods)):
            say(f"{scene}: times in turns")
            first = {name: methods[name] for name in (RATIO_TO,) if name in methods}
            with writing(sequence.folder, "time"):
                time_methods(sequence, {**first, **methods})
        return scores_of(sequence)

    def sequence(self, scene: str, plain: bool = False) -> FrameSequence:
        """Frames and references of one of the two scenes; both inputs share the references."""
        def rendered(name: str, estimator: tuple[str, str],
                     like: FrameSequence | None = None) -> FrameSequence:
            return render(self.data / name, scene, self.frames, self.sizes[scene], self.spp,
                          self.seed, estimator, like)

        ours = rendered(scene, OURS)
        return rendered(f"{scene}_plain", PLAIN, ours) if plain else ours

    @cached_property
    def others(self) -> dict[str, Scores]:
        """Label -> scores on our input of scenes and frames that nothing was tuned on."""
        found = {}
        for label, (scene, frames, size, seed) in OTHERS.items():
            name = f"other_{Path(scene).stem}"
            sequence = render(self.data / name, str(ROOT / scene) if scene.endswith(".py")
                              else scene, frames, size, self.others_spp, seed)
            known = all_methods(sequence)
            denoise(sequence, {m: known[m] for m in (BEST, PEER, STRONGEST, "atrous")
                               if m in known}, self.again)
            found[label] = scores_of(sequence)
        return found

    @cached_property
    def light(self) -> dict[str, Scores]:
        """Name -> scores of all methods on the generated scenes that are kept to check with."""
        return {name: self.scored_by_all(render(self.data / name, name, LIGHT_FRAMES, LIGHT_SIZE,
                                                self.others_spp, 5))
                for name in (catalog.GENERATED[i] for i in KEPT)}

    @cached_property
    def hard_scores(self) -> dict[str, Scores]:
        """Name -> scores of all methods on the hard scenes."""
        return {name: self.scored_by_all(self.hard_sequence(name)) for name in self.hard}

    @cached_property
    def suite(self) -> dict[suite_study.Group, dict[str, Scores]]:
        """Scores of what `onespp lead --suite` asks for, on the sequences that are here anyway."""
        def case(scene: str, plain: bool) -> Scores:
            name = scene.removeprefix("hard/")
            if not plain:
                return {**self.ours, **self.light, **self.hard_scores}[name]
            original = FrameSequence.open(self.data / scene)
            say(f"{scene}: as plain frames")
            sequence = plain_copy(original, self.data / "plain" / scene)
            denoise(sequence, {m: method for m, method in all_methods(sequence).items()
                               if m in (BEST, *suite_study.PLAIN_PEERS)}, self.again)
            return scores_of(sequence)

        hard = tuple(f"hard/{name}" for name in self.hard)
        return {group: {scene: case(scene, group.plain) for scene in group.scenes}
                for group in suite_study.groups([*self.light], hard)}

    @cached_property
    def worst(self) -> dict[str, failures.Failure]:
        """Method -> where among the hard scenes it is farthest behind the mean of ours."""
        return {name: failures.find(self.hard_scores, name, METHODS)
                for name in names_in(self.hard_scores.values()) if name != INPUT}

    @cached_property
    def hard_rows(self) -> list[hard_study.Row]:
        """What the history of every method of ours is worth on the hard scenes."""
        rows = []
        for name in self.hard:
            sequence = self.hard_sequence(name)
            say(f"hard/{name}: judge")
            rows += hard_study.judge(sequence, name, HARD[name].event, HARD[name].diffuse)
        return rows

    def hard_sequence(self, name: str) -> FrameSequence:
        scene = HARD[name].make()
        needed = sorted({c for method in METHODS.values() for c in method.needs})
        return render(self.data / "hard" / name, f"hard/{name}", f"0:{scene.frames}",
                      f"{scene.width}x{scene.height}", self.hard_spp, 0, added=needed)

    def scored_by_all(self, sequence: FrameSequence) -> Scores:
        denoise(sequence, all_methods(sequence), self.again)
        return scores_of(sequence)


def say(text: str) -> None:
    click.echo(text, err=True)


def render(folder: Path, scene_name: str, frames: str, size: str, spp: int, seed: int,
           estimator: tuple[str, str] = OURS, like: FrameSequence | None = None,
           added: Iterable[str] = REPLAY) -> FrameSequence:
    """Render what is missing; references are copied from `like`, which has the same ones."""
    scene = catalog.load(scene_name)
    height, width = parse_size(size)
    direct, sampler = estimator
    command = command_of(scene_name, frames, size, spp, seed, direct, sampler)
    job = RenderJob(scene, parse_frames(frames), height, width, seed=seed, reference_spp=spp,
                    added=tuple(added), direct=direct, sampler=sampler, command=command)
    say(f"{folder.name}: render {frames} at {size}, reference {spp} spp")
    with writing(folder, "render"):
        if like is not None:
            sequence = FrameSequence.create(folder, job.manifest())
            for i in sequence.frames:
                if like.has_reference(i) and not sequence.has_reference(i):
                    sequence.write_reference(i, like.read_reference(i))
        return render_sequence(job, folder)


def command_of(scene: str, frames: str, size: str, spp: int, seed: int, direct: str,
               sampler: str) -> str:
    """The command line that renders the same."""
    scene = os.path.relpath(scene, ROOT) if scene.endswith(".py") else scene
    return (f"onespp render {scene} --frames {frames} --size {size} --reference-spp {spp} "
            f"--seed {seed} --channels +gradient --direct {direct} --sampler {sampler}")


def all_methods(sequence: FrameSequence) -> dict[str, Method]:
    """Every method, and every peer that can run here, that the sequence has the channels of."""
    names = [*METHODS, *(name for name, peer in PEERS.items() if peer.available())]
    return {name: method for name in names
            if set((method := build(name)).needs) <= set(sequence.channels)}


def denoise(sequence: FrameSequence, methods: Mapping[str, Method], again: bool) -> None:
    """Denoise by each method that has no complete results of the same parameters."""
    for name, method in methods.items():
        if again or not is_denoised(sequence, name, method):
            say(f"{sequence.folder.name}: denoise {name}")
            with writing(sequence.folder, f"denoise-{name}"):
                denoise_sequence(sequence, method, name,
                                 command=f"onespp denoise {sequence.folder.name} --method {name}")


def is_denoised(sequence: FrameSequence, name: str, method: Method) -> bool:
    return (name in sequence.methods() and all(sequence.has_result(name, i)
                                               for i in sequence.frames)
            and sequence.read_run(name).parameters == parameters(method))


def timed(sequence: FrameSequence, methods: Mapping[str, Method]) -> bool:
    """Whether times.json has them all, with the same parameters."""
    times = read_times(sequence.folder)
    return times is not None and all(
        name in times.methods and times.methods[name].parameters == parameters(method)
        for name, method in methods.items())


@cache
def scores_in(folder: Path) -> Scores:
    say(f"{folder.name}: score")
    with writing(folder, "score"):
        return score(FrameSequence.open(folder))


def scores_of(sequence: FrameSequence) -> Scores:
    return scores_in(sequence.folder)


# The tables: each part makes the text of its block.

def number(score: MethodScore | None, measure: str, form: str) -> str:
    """With its standard error, if that shows; `≥` marks a bound."""
    return mean_number([score] if score else [], measure, form)


def mean_number(scores: Sequence[MethodScore], measure: str, form: str) -> str:
    """Mean over scores, as `number` writes one; "" where one of them has none."""
    values = [v for score in scores if (v := score[measure]) is not None]
    if not values or len(values) < len(scores):
        return ""
    text = ("≥ " if any(measure in score.bounds for score in scores) else "") + format(
        np.mean(values), form)
    error = format(np.linalg.norm([s.errors.get(measure, 0.0) for s in scores]) / len(scores), form)
    return f"{text} ±{error}" if float(error) else text


def milliseconds(score: MethodScore | None) -> str:
    ms = score.ms_per_frame if score else None
    return "" if ms is None else f"{ms:.1f}" if ms < 10 else f"{ms:.0f}"


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    heads = list(heads)
    return "\n".join("| " + " | ".join(cells) + " |"
                     for cells in (heads, ["---"] * len(heads), *rows))


def named(name: str) -> str:
    return "input, 1 spp" if name == INPUT else f"**`{name}`**" if name == BEST else f"`{name}`"


def frames_text(frames: list[int]) -> str:
    """Frames as one would type them: 0:30, or 60:92:2 for every second."""
    steps = {b - a for a, b in pairwise(frames)}
    if len(steps) == 1 and (step := steps.pop()) > 1:
        return f"{frames[0]}:{frames[-1] + step}:{step}"
    return format_frames(frames)


def conditions(scores: Scores) -> str:
    """What numbers of a sequence stand on, with the score of its own input."""
    noisy, flip, floor = (scores.methods[INPUT]["psnr_srgb"], scores.flip_floor,
                          scores.headline_floor)
    if scores.reference_halves:
        known = "in halves" + (f" (floor of FLIP {flip:.3f})" if flip is not None else "")
    else:
        known = f"(noise floor {floor:.1f} dB)" if floor is not None else "(noise floor not known)"
    return (f"`{scores.scene}`: frames {frames_text(scores.frames)} at {scores.size[0]}x"
            f"{scores.size[1]}, reference {scores.reference_spp} spp {known}, seed {scores.seed}, "
            "input " + (f"{noisy:.2f} dB" if noisy is not None else "without a score"))


def machine_of(plan: Plan) -> str:
    times = read_times(plan.data / next(iter(plan.sizes)))
    if times is None:
        return "times of single runs"
    return f"times in turns on {times.machine}, {times.threads} threads"


def names_in(scores: Iterable[Scores]) -> list[str]:
    """Methods of several scores: the input, ours as in `METHODS` (the best one last), peers."""
    there = {name for s in scores for name in s.methods}
    order = [INPUT, *(m for m in METHODS if m != BEST), *PEERS, BEST]
    return [name for name in order if name in there]


def summary(plan: Plan) -> str:
    ours = plan.ours
    heads = ["method", *(f"{scene} {what}" for scene in ours
                         for what in ("PSNR", "FLIP", "flicker", "ms"))]
    rows = [[named(name), *(cell for scores in ours.values() for cell in _four(scores, name))]
            for name in SUMMARY if any(name in scores.methods for scores in ours.values())]
    return (f"{table(heads, rows)}\n\nPSNR in dB on {TONE_MAP}, mean over frames. "
            f"{'; '.join(map(conditions, ours.values()))}; {machine_of(plan)}.")


def _four(scores: Scores, name: str) -> list[str]:
    found = scores.methods.get(name)
    return [number(found, "psnr_srgb", ".2f"), number(found, "flip", ".3f"),
            number(found, "flicker", ".3f"), milliseconds(found)]


def all_scores(plan: Plan) -> str:
    heads = ["method", *(head for scene in plan.pairs for head in (
        f"{scene}, plain input", scene, "FLIP", "flicker", "ms", "ratio"))]
    ratios = {scene: read_times(plan.data / scene) for scene in plan.pairs}
    rows = []
    for name in names_in(s for pair in plan.pairs.values() for s in pair):
        row = [named(name)]
        for scene, (plain, ours) in plan.pairs.items():
            times = ratios[scene]
            measured = times.methods.get(name) if times else None
            row += [number(plain.methods.get(name), "psnr_srgb", ".2f"), *_four(ours, name),
                    f"{measured.ratio:.2f}" if measured else ""]
        rows.append(row)
    first = next(iter(ratios.values()))
    lines = [f"{conditions(ours)} (plain {number(plain.methods[INPUT], 'psnr_srgb', '.2f')} dB)"
             for plain, ours in plan.pairs.values()]
    return (f"{table(heads, rows)}\n\nPSNR in dB on {TONE_MAP}, mean over frames; FLIP, flicker "
            f"and time on our input. {'; '.join(lines)}; {machine_of(plan)}"
            + (f"; ratio: median ratio to `{first.ratio_to}`, step by step." if first else "."))


def lead(plan: Plan) -> str:
    if not all(PEER in s.methods for pair in plan.pairs.values() for s in pair):
        return f"`{PEER}` cannot run on this machine (`pip install mitsuba-oidn`)."
    return (f"{lead_table(BEST, BEST_FORM, plan.pairs)}\n\n"
            + "; ".join(conditions(pair[1]) for pair in plan.pairs.values())
            + f"; PSNR on {TONE_MAP}.")


def others(plan: Plan) -> str:
    methods = [name for name in (INPUT, BEST, PEER, STRONGEST, "atrous")
               if any(name in scores.methods for scores in plan.others.values())]
    rows = [[label, *(_three(scores.methods.get(name)) for name in methods)]
            for label, scores in plan.others.items()]
    heads = ["on our input: PSNR dB (FLIP, flicker)", *map(named, methods)]
    return (f"{table(heads, rows)}\n\n" + "; ".join(map(conditions, plan.others.values()))
            + f"; PSNR on {TONE_MAP}.")


def light(plan: Plan) -> str:
    columns = (INPUT, "svgf", PEER, STRONGEST, BEST)
    heads = ["scene", *map(named, columns), "over the best form of OIDN", "flicker, share"]
    rows, leads = [], []
    for name, scores in plan.light.items():
        found = scores.methods
        cells = [number(found.get(column), "psnr_srgb", ".2f") for column in columns]
        if any(form in found for form in OIDN_FORMS):
            peer, ours = found[peer_in(scores, BEST_FORM, name)], found[BEST]
            leads.append(psnr_of(ours) - psnr_of(peer))
            a, b = ours["flicker"], peer["flicker"]
            cells += [f"{leads[-1]:+.2f}", f"{a / b:.2f}" if a and b else ""]
        rows.append([f"`{name}`", *cells])
    mean = f" Mean lead {np.mean(leads):+.2f} dB, least {min(leads):+.2f}." if leads else ""
    return (f"{table(heads, rows)}\n\nPSNR in dB on {TONE_MAP}, mean over "
            f"{_light_conditions(plan)}.{mean}")


def targets(plan: Plan) -> str:
    return (f"{suite_study.markdown(BEST, plan.suite)}\n\nPSNR in dB on {TONE_MAP}, mean over "
            f"frames; {'; '.join(map(conditions, plan.ours.values()))}; generated scenes: "
            f"{_light_conditions(plan)}; hard: {_hard_conditions(plan)}")


def _light_conditions(plan: Plan) -> str:
    return (f"frames {LIGHT_FRAMES} at {LIGHT_SIZE}, references {plan.others_spp} spp in halves, "
            "seed 5")


def methods(plan: Plan) -> str:
    """A row a method: where it is from, what it is worth, where it fails."""
    kept = plan.light.values()
    heads = ["method", "source", "kept scenes, PSNR", "FLIP", "flicker",
             *(head for scene in plan.ours for head in (scene, "ms")), "fails most on"]
    rows = []
    for name in names_in([*plan.ours.values(), *kept]):
        found = [s.methods[name] for s in kept if name in s.methods]
        row = [named(name), from_code.cited(name) if name != INPUT else "",
               *(mean_number(found, measure, form) if len(found) == len(kept) else ""
                 for measure, form in (("psnr_srgb", ".2f"), ("flip", ".3f"), ("flicker", ".3f")))]
        for scores in plan.ours.values():
            psnr, _, _, ms = _four(scores, name)
            row += [psnr, ms]
        failure = plan.worst.get(name)
        rows.append([*row, f"`{failure.scene}`, frame {failure.frame}" if failure else ""])
    floors = [s.flip_floor for s in kept if s.flip_floor is not None]
    floor = f" (floor of FLIP {np.mean(floors):.3f})" if len(floors) == len(kept) else ""
    names = [*plan.light]
    return (f"{table(heads, rows)}\n\nPSNR in dB on {TONE_MAP}, mean over frames, ± a standard "
            f"error by the noise of the reference. Kept scenes: mean over {len(kept)} scenes, "
            f"`{names[0]}` to `{names[-1]}`, {_light_conditions(plan)}{floor}; "
            f"{'; '.join(map(conditions, plan.ours.values()))}; {machine_of(plan)}.")


def what_fails(plan: Plan) -> str:
    """A sentence and a picture a method."""
    shown = [failures.markdown(name, failure, HARD[failure.scene].make().about)
             for name, failure in plan.worst.items()]
    return "\n\n".join([*shown, _hard_conditions(plan)])


def draw_failures(plan: Plan, folder: Path) -> None:
    """The pictures that `what_fails` shows, and no others."""
    for name, failure in plan.worst.items():
        write_bytes(folder / f"{name}.jpg", failures.picture(
            FrameSequence.open(plan.data / "hard" / failure.scene), name, failure.frame, METHODS))
    for old in folder.glob("*.jpg"):
        if old.stem not in plan.worst:
            old.unlink()


def _three(score: MethodScore | None) -> str:
    psnr, flip, flicker = (number(score, m, f) for m, f in (
        ("psnr_srgb", ".2f"), ("flip", ".3f"), ("flicker", ".3f")))
    return f"{psnr} ({flip}, {flicker})" if psnr else ""


def ablation(plan: Plan) -> str:
    results = {}
    for scene in plan.sizes:
        say(f"{scene}: ablation of svgf")
        results[scene] = ablate(plan.sequence(scene), variants("svgf"))
    return (f"{ablation_table('svgf', results)}\n\n"
            + "; ".join(conditions(scores_of(plan.sequence(s))) for s in plan.sizes)
            + f"; PSNR on {TONE_MAP}.")


def hard_of_best(plan: Plan) -> str:
    rows = plan.hard_rows
    noisy = {row.scene: np.mean(row.psnr) for row in rows if row.method == INPUT}
    heads = ["scene", "input, dB", f"`{BEST}`, dB",
             "gain over history-free, dB: mean (worst frame)", "frames to recover", "energy"]
    cells = [[f"`{r.scene}`", f"{noisy[r.scene]:.2f}", f"{np.mean(r.psnr):.2f}",
              f"{r.gain:+.1f} ({r.worst:+.1f})",
              "" if r.recovery is None else f"{'' if r.recovered else '> '}{r.recovery}",
              f"{r.energy:.3f}"] for r in rows if r.method == BEST]
    return f"{table(heads, cells)}\n\n{_hard_conditions(plan)}"


def hard(plan: Plan) -> str:
    return f"{hard_study.markdown(plan.hard_rows)}\n\n{_hard_conditions(plan)}"


def _hard_conditions(plan: Plan) -> str:
    scene = HARD[plan.hard[0]].make()
    return (f"{len(plan.hard)} scenes, {scene.frames} frames of {scene.width}x{scene.height}, "
            f"references {plan.hard_spp} spp in halves, seed 0, PSNR on {TONE_MAP}.")


PARTS: dict[str, tuple[Path, Callable[[Plan], str]]] = {
    "summary": (ROOT / "README.md", summary),
    "scores": (ROOT / "docs/results.md", all_scores),
    "lead": (ROOT / "docs/results.md", lead),
    "others": (ROOT / "docs/results.md", others),
    "light": (ROOT / "docs/results.md", light),
    "targets": (ROOT / "docs/results.md", targets),
    "ablation": (ROOT / "docs/results.md", ablation),
    "hard-onespp": (ROOT / "docs/results.md", hard_of_best),
    "hard": (ROOT / "docs/results.md", hard),
    "methods": (ROOT / "docs/methods.md", methods),
    "failures": (ROOT / "docs/methods.md", what_fails),
}


def block(name: str, text: str, command: str) -> str:
    return (f"<!-- results:{name} -->\n{text}\n\nPrinted by `{command}`.\n<!-- /results -->")


def replaced(page: str, name: str, new: str) -> str:
    """The page with the block of that name replaced; InputError if it has no such block."""
    pattern = re.compile(rf"<!-- results:{re.escape(name)} -->.*?<!-- /results -->", re.S)
    if len(pattern.findall(page)) != 1:
        raise InputError(f"there is no one block `<!-- results:{name} -->` to write to")
    return pattern.sub(lambda _: new, page)


def own_command(name: str, plan: Plan) -> str:
    """The command line that prints a part."""
    sizes = " ".join(f"--{scene}-size {size}" for scene, size in plan.sizes.items())
    two = f"--frames {plan.frames} {sizes} --reference-spp {plan.spp} --seed {plan.seed}"
    others = f"--others-spp {plan.others_spp}"
    hard = f"--hard-spp {plan.hard_spp}" + "".join(
        f" --hard {scene}" for scene in plan.hard if plan.hard != tuple(HARD))
    given = {"others": others, "light": others, "hard-onespp": hard, "hard": hard,
             "failures": hard, **dict.fromkeys(("methods", "targets"),
                                               f"{two} {others} {hard}")}.get(name, two)
    return f"python docs/results.py --parts {name} {given}"


@click.command()
@click.option("--parts", default=",".join(PARTS), metavar="NAMES",
              help=f"Which tables, of {', '.join(PARTS)}; default all.")
@click.option("--frames", default="0:30", show_default=True, metavar="RANGE",
              help="Frames of box and room.")
@click.option("--box-size", default="256x256", show_default=True, metavar="WxH")
@click.option("--room-size", default="320x180", show_default=True, metavar="WxH")
@click.option("--reference-spp", default=64, show_default=True, metavar="N",
              help="Of box and room.")
@click.option("--others-spp", default=64, show_default=True, metavar="N",
              help="Of the scenes that nothing was tuned on, and of all kinds of light.")
@click.option("--hard-spp", default=1024, show_default=True, metavar="N",
              help="Of the hard scenes.")
@click.option("--seed", default=0, show_default=True, metavar="N", help="Of box and room.")
@click.option("--hard", "hard_names", multiple=True, metavar="NAME", type=click.Choice([*HARD]),
              help="A hard scene; may be given several times; default all.")
@click.option("--data", type=click.Path(path_type=Path), default=ROOT / "data/results",
              metavar="DIR", help="Folder of the sequences; default data/results.")
@click.option("--again", is_flag=True, help="Denoise and time anew; renders are kept.")
@click.option("--write", is_flag=True,
              help="Write the tables into README.md and the docs, and the pictures with them.")
@click.option("--threads", type=int, metavar="N", help="CPU threads; default all.")
def results(parts: str, frames: str, box_size: str, room_size: str, reference_spp: int,
            others_spp: int, hard_spp: int, seed: int, hard_names: tuple[str, ...], data: Path,
            again: bool, write: bool, threads: int | None) -> None:
    """Print the tables of README.md and the docs as Markdown."""
    names = [name.strip() for name in parts.split(",") if name.strip()]
    unknown = [name for name in names if name not in PARTS]
    if unknown or not names:
        raise InputError(f"--parts names {unknown[0] if unknown else 'nothing'}: use some of "
                         f"{', '.join(PARTS)}")
    use("auto", threads)
    plan = Plan(frames, {"box": box_size, "room": room_size}, reference_spp, others_spp, hard_spp,
                seed, hard_names or tuple(HARD), data, again)
    for name in names:
        path, make = PARTS[name]
        text = block(name, make(plan), own_command(name, plan))
        if write:
            path.write_text(replaced(path.read_text("utf-8"), name, text), "utf-8")
            say(f"wrote {name} into {path.relative_to(ROOT)}")
        else:
            click.echo(f"{text}\n")
    if write and "scores" in names:
        scores = plan.pairs["box"][1]
        shown = {name: s for name, s in scores.methods.items() if name not in NOT_PLOTTED}
        plot_speed_against_error(scores.model_copy(update={"methods": shown}),
                                 ROOT / "docs/speed_box.png")
    if write and "failures" in names:
        draw_failures(plan, ROOT / "docs/failures")


if __name__ == "__main__":
    run_command(results, name="python docs/results.py")
