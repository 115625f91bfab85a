import numpy as np
import pytest

from onespp.denoise.catalog import parameters
from onespp.denoise.cli.ablate import ablate as ablate_command
from onespp.denoise.studies.ablation import ablate, markdown, variants
from onespp.render.cli.terminal import run
from onespp.render.errors import InputError
from onespp.render.files.manifest import Manifest
from onespp.render.files.sequence import FrameSequence, Reference
from tests.support.frames import make_frame, noisy


def sequence_in(folder, reference=True):
    clean = [make_frame(16, 20, index=i) for i in range(3)]
    sequence = FrameSequence.create(folder, Manifest(
        scene="wall", frames=(0, 1, 2), width=20, height=16,
        reference_spp=64 if reference else None, objects=("wall", "board"),
        channels=("color", "normal", "position", "depth", "id", "albedo")))
    for i, frame in enumerate(clean):
        sequence.write_frame(noisy(frame, i))
        if reference:
            zero = np.zeros((16, 20, 3), np.float32)
            sequence.write_reference(i, Reference(frame["color"], zero, 64))
    return sequence


def test_a_variant_for_each_switch_differs_in_it_alone():
    made = variants("svgf")
    whole = parameters(made["as it is"])
    switches = [k for k, v in whole.items() if isinstance(v, bool)]
    assert list(made) == ["as it is", *(f"without {k}" for k in switches)]
    for switch in switches:
        assert parameters(made[f"without {switch}"]) == {**whole, switch: False}
    assert "with nearest" in variants("temporal")


def test_a_method_without_switches_and_a_sequence_without_reference_are_refused(tmp_path):
    with pytest.raises(InputError, match="oidn-tiny"):
        variants("oidn-tiny")
    with pytest.raises(InputError, match="no reference to compare with"):
        ablate(sequence_in(tmp_path / "bare", reference=False), variants("temporal"))


def test_the_table_says_what_the_parts_are_worth(tmp_path, capsys):
    folder = sequence_in(tmp_path / "wall").folder
    rows = ablate(FrameSequence.open(folder), variants("svgf"))
    values = {row.name: row.means["psnr_srgb"] or 0.0 for row in rows}
    whole, alone = values["as it is"], values["without accumulate"]
    assert alone < whole
    assert values["without split"] == whole  # these frames are one signal anyway
    text = markdown("svgf", {"wall": rows})
    assert text.splitlines()[0] == "| `svgf` | wall PSNR | wall FLIP | wall flicker |"
    assert f"| without accumulate | {alone:.2f} ({alone - whole:+.2f}) |" in text
    run(ablate_command, [str(folder)])
    printed = capsys.readouterr().out
    assert text in printed
    assert "wall: wall, 3 frames of 20x16, seed 0" in printed
