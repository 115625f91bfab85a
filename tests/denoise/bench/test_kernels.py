import io
import json
from types import SimpleNamespace
from typing import Any

import drjit as dr
import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

import onespp.cli
from onespp.denoise.bench.kernels import KERNELS, Scaling, max_error, measure_one_thread, scaling
from onespp.denoise.bench.probe_frames import probe
from onespp.denoise.catalog import METHODS
from onespp.denoise.report.bench_table import print_scaling


def test_the_command_prints_the_figures_of_every_kernel_as_json():
    result = CliRunner().invoke(onespp.cli.app, ["bench", "--size", "20x12", "--repeats", "2",
                                             "--json", "-"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert (found["width"], found["height"], found["repeats"]) == (20, 12, 2)
    assert found["bandwidth_gb_s"] > 0
    assert found["arithmetic_gflop_s"] > 0
    assert set(found["kernels"]) == set(KERNELS) <= set(METHODS)
    for name, row in found["kernels"].items():
        assert 0 < row["ms"] < 60_000, name
        assert 0 < row["call_ms"] < 60_000, name
        assert 0 <= row["max_error"] < 1e-2, name
        planes = 4 * 8 * 20 * 12  # the least: eight planes of floats
        assert planes < row["peak_mb"] * 2**20 < 1e6, name
        assert row["bytes_a_pixel"] == pytest.approx(row["peak_mb"] * 2**20 / (20 * 12))
        assert found["threads"] < 2 or row["speed_up"] > 0
        if found["oidn_fast_ms"] is not None:
            assert row["share_of_oidn_fast"] == pytest.approx(row["ms"] / found["oidn_fast_ms"])


def test_scaling_has_every_kernel_at_every_size():
    result = scaling(1, sizes=[(6, 9), (12, 5)])
    assert result.sizes == ["9x6", "5x12"]
    assert set(KERNELS) <= set(result.ms)
    assert all(len(ms) == 2 and min(ms) > 0 for ms in result.ms.values())
    out = io.StringIO()
    print_scaling(Scaling(["10x10", "20x10"], 1, {"atrous": [0.5, 1.25]}),
                  Console(file=out, width=80))
    assert "5000.0" in out.getvalue()  # ns a pixel: 0.5 ms over 100
    assert "6250.0" in out.getvalue()


def test_measuring_with_one_thread_leaves_the_number_of_threads():
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
