import io
import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import drjit as dr
import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

import onespp.cli
from onespp.denoise.bench import kernels, machine_limits
from onespp.denoise.bench.kernels import (
    KERNELS,
    Bench,
    Row,
    Scaling,
    max_error,
    measure_one_thread,
    scaling,
)
from onespp.denoise.bench.probe_frames import probe
from onespp.denoise.catalog import METHODS, build, channels_read
from onespp.denoise.inputs.signals import USED
from onespp.denoise.peers.oidn import AVAILABLE
from onespp.denoise.report.bench_table import print_bench, print_scaling
from onespp.render.channels import CAUSTIC, GROUPED, LAYER, REPLAY, SHADOW
from onespp.render.host import backend

KERNEL_MS, CALL_MS = 4.0, 10.0


@pytest.fixture
def clock(monkeypatch):
    """Every kernel takes 4 ms, three times as long with one thread; every other call 10 ms."""
    threads = dr.thread_count()

    def timed(function):
        result = function()
        ms = KERNEL_MS if function.__name__ == "kernel" else CALL_MS
        return result, ms * (3 if dr.thread_count() < threads else 1)

    monkeypatch.setattr(kernels, "timed", timed)
    monkeypatch.setattr(machine_limits, "timed", timed)


@pytest.mark.parametrize("some", [
    ("temporal", "svgf", "onespp"), pytest.param(tuple(METHODS), marks=pytest.mark.slow)])
def test_the_command_prints_the_figures_of_every_kernel_as_json(clock, monkeypatch, some):
    monkeypatch.setattr(kernels, "KERNELS", {name: KERNELS[name] for name in some})
    result = CliRunner().invoke(onespp.cli.app, ["bench", "--size", "20x12", "--repeats", "2",
                                             "--json", "-"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert (found["width"], found["height"], found["repeats"]) == (20, 12, 2)
    assert found["bandwidth_gb_s"] == pytest.approx(12 * 2**24 / CALL_MS * 1e-6)
    assert found["arithmetic_gflop_s"] == pytest.approx(2 * 12 * 64 * 2**20 / CALL_MS * 1e-6)
    oidn = CALL_MS if AVAILABLE else None
    assert found["oidn_fast_ms"] == oidn
    several = found["device"] == "llvm" and found["threads"] > 1
    assert list(found["kernels"]) == list(some)
    for name, row in found["kernels"].items():
        assert (row["ms"], row["call_ms"], row["first_ms"]) == (KERNEL_MS, CALL_MS, CALL_MS), name
        assert row["speed_up"] == (3 if several else None)
        assert row["share_of_oidn_fast"] == (0.4 if oidn else None)
        assert row["call_share_of_oidn_fast"] == (1 if oidn else None)
        assert row["max_error"] < 1e-4, name
        for share, count, most in (
                ("share_of_bandwidth", KERNELS[name].bytes, "bandwidth_gb_s"),
                ("share_of_arithmetic", KERNELS[name].operations, "arithmetic_gflop_s")):
            expected = count and pytest.approx(count * 240 / KERNEL_MS * 1e-6 / found[most])
            assert row[share] == expected, name
        planes = 4 * 8 * 20 * 12  # the least: eight planes of floats
        assert planes < row["peak_mb"] * 2**20 < 1.2e6, name
        assert row["bytes_a_pixel"] == pytest.approx(row["peak_mb"] * 2**20 / (20 * 12))


def test_the_table_says_where_nothing_was_counted():
    row = Row(4.0, 10.0, 200.0, 0.04, 0.1, 5e-6, None, None, None, 2.0, 300.0)
    counted = replace(row, share_of_bandwidth=0.25, share_of_arithmetic=0.125, speed_up=1.75)
    out = io.StringIO()
    print_bench(Bench({"svgf": row, "atrous": counted}, 20, 12, 2, 100.0, 12.0, 90.0, "llvm", 2,
                      "x86"), Console(file=out, width=100))
    cells = [line.replace("│", " ").split() for line in out.getvalue().splitlines()]
    assert ["svgf", "4.0", "0.040", "10.0", "0.100", "200", "-"] in cells
    assert ["svgf", "5e-06", "-", "-", "2", "300"] in cells
    assert ["atrous", "4.0", "0.040", "10.0", "0.100", "200", "1.75"] in cells
    assert ["atrous", "5e-06", "25%", "12%", "2", "300"] in cells


def test_the_calls_of_a_method_of_ones_own_stand_beside_the_kernels(clock, monkeypatch, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("class Mine:\n    def __call__(self, frame, state):\n"
                    "        return frame['color'], state\n")
    monkeypatch.setattr(kernels, "KERNELS", {"temporal": KERNELS["temporal"]})
    arguments = ["bench", "--size", "20x12", "--repeats", "2", "--method", str(path)]
    result = CliRunner().invoke(onespp.cli.app, [*arguments, "--json", "-"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)["kernels"]
    assert list(found) == ["temporal", "mine"]
    assert (found["mine"]["ms"], found["mine"]["call_ms"]) == (None, CALL_MS)
    out = io.StringIO()
    print_bench(Bench({"mine": Row(**found["mine"])}, 20, 12, 2, 100.0, 12.0, 90.0, "llvm", 2,
                      "x86"), Console(file=out, width=100))
    assert out.getvalue().count("mine") == 1
    result = CliRunner().invoke(onespp.cli.app, [*arguments, "--scaling"])
    assert "--scaling takes no --method" in str(result.exception)


@pytest.mark.parametrize("some", [
    ("temporal", "atrous"), pytest.param(tuple(METHODS), marks=pytest.mark.slow)])
def test_scaling_has_every_kernel_at_every_size(clock, monkeypatch, some):
    monkeypatch.setattr(kernels, "KERNELS", {name: KERNELS[name] for name in some})
    result = scaling(1, sizes=[(6, 9), (12, 5)])
    assert result.sizes == ["9x6", "5x12"]
    network = {"OIDN fast": [CALL_MS] * 2} if AVAILABLE else {}
    assert result.ms == {name: [KERNEL_MS] * 2 for name in some} | network
    out = io.StringIO()
    print_scaling(Scaling(["10x10", "20x10"], 1, {"atrous": [0.5, 1.25]}),
                  Console(file=out, width=80))
    assert "5000.0" in out.getvalue()  # ns a pixel: 0.5 ms over 100
    assert "6250.0" in out.getvalue()


def test_measuring_with_one_thread_leaves_the_number_of_threads(monkeypatch):
    monkeypatch.setattr(backend, "choose", lambda: "llvm")
    seen = []
    run: Any = SimpleNamespace(one_thread_ms=seen,
                               measure_kernel=lambda i: float(dr.thread_count()))
    before = dr.thread_count()
    measure_one_thread([run], 0)
    assert seen == ([1.0] if before > 1 else [])
    assert dr.thread_count() == before


@pytest.mark.parametrize("name", KERNELS)
def test_every_kernel_is_near_its_formula_on_the_probe(name):
    assert 0 < max_error(name) < 1e-4


def test_the_probe_has_surfaces_background_and_motion():
    first, second = probe(24, 32, 0), probe(24, 32, 1)
    assert set(np.unique(first["id"])) == {-1, 0, 1}
    assert (first["id"] != second["id"]).any()
    assert (first.world_from_object[1] != second.world_from_object[1]).any()
    surface = first["id"] >= 0
    np.testing.assert_allclose(np.linalg.norm(first["normal"], axis=-1)[surface], 1, atol=1e-6)
    world = np.concatenate([first["position"], np.ones((24, 32, 1))], -1)
    screen = world @ first.screen_from_world.T
    y, x = np.mgrid[:24, :32] + 0.5
    there = screen[surface, :2] / screen[surface, 3:]
    np.testing.assert_allclose(there, np.stack([x, y], -1)[surface], atol=1e-4)
    np.testing.assert_allclose(screen[surface, 3], first["depth"][surface], rtol=1e-6)


@pytest.mark.parametrize("index", [0, 2])
def test_the_textured_probe_has_all_that_methods_read_and_it_agrees(index):
    frame = probe(24, 32, index)
    read = {c for name in METHODS for c in channels_read(build(name), frame.images)}
    none = {*GROUPED, *CAUSTIC, *LAYER}  # it has one light, no balls and no glass
    assert {*USED, *SHADOW, *REPLAY, "albedo", "emission"} - none <= read
    direct = frame["visibility"][..., None] * frame["unshadowed"]
    np.testing.assert_allclose(frame["direct"], direct, rtol=1e-6)
    np.testing.assert_allclose(frame["color"], direct + frame["indirect"], rtol=1e-6)
    assert (frame["specular"] < frame["indirect"]).all()
    surface, blocked = frame["id"] >= 0, frame["blocker_distance"] > 0
    assert 30 < blocked.sum() < (frame["id"] == 0).sum() / 2
    np.testing.assert_array_equal(frame["visibility"] == 0, blocked)
    np.testing.assert_array_equal(frame["blocker_id"], np.where(blocked, 1, -1))
    np.testing.assert_array_equal(frame["light_id"], np.where(surface, 2, -1))
    ray = frame["light"] / np.maximum(np.linalg.norm(frame["light"], axis=-1, keepdims=True), 1e-9)
    hit = frame["position"] + frame["blocker_distance"][..., None] * ray
    np.testing.assert_allclose(hit[blocked, 2], 6, atol=1e-5)      # on the square
    on_square = hit[blocked, :2] - frame.world_from_object[1][:2, 3]
    assert np.abs(on_square).max() < 1.5 + 1e-5


def test_the_probe_shades_one_sample_a_stratum_again_as_the_lamp_and_the_shadow_change():
    frame = probe(24, 33, 1)
    now, before = frame["replay"], frame["replay_before"]
    sampled = (now >= 0).all(-1)
    np.testing.assert_array_equal(sampled, (before >= 0).all(-1))
    assert (sampled.reshape(8, 3, 11, 3).sum((1, 3)) == 1).all()
    change = 1 + 0.1 * np.sin(1)
    np.testing.assert_allclose(now[sampled, 1], change * before[sampled, 1], rtol=1e-5)
    lit = sampled & (now[..., 0] > 0) & (before[..., 0] > 0)
    np.testing.assert_allclose(now[lit, 0], change * before[lit, 0], rtol=1e-5)
    np.testing.assert_array_equal(now[sampled, 0] == 0, frame["blocker_distance"][sampled] > 0)
