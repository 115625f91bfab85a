"""Networks: their formulas in float64, what is trained and what denoises alike."""

import numpy as np
import pytest

from onespp.denoise.catalog import build
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.learned.architecture import WIDTHS
from onespp.denoise.methods.learned.networks import NETWORKS, architecture_of
from onespp.denoise.methods.learned.pyramid import Pyramid
from onespp.denoise.methods.learned.rae import Rae
from onespp.denoise.methods.learned.unet import Unet
from onespp.denoise.methods.learned.weights import (
    Network,
    read_network,
    shipped,
    shipped_or,
    write_network,
)
from onespp.denoise.oracles import learned as oracles
from onespp.denoise.oracles.rae import rae
from onespp.denoise.oracles.unet import unet
from onespp.render.errors import InputError
from tests.support.frames import make_frame, noisy, translation, turn, with_images
from tests.support.recordings import compiled

HEIGHT, WIDTH = 40, 37  # padded to 64x64, or 48x48: mirrored by more than half of it
METHODS, ORACLES = {"rae": Rae, "unet": Unet}, {"rae": rae, "unet": unet}

each_kind = pytest.mark.parametrize("kind", NETWORKS)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Of each kind the narrowest network, not trained, with biases."""
    random, folder = np.random.default_rng(4), tmp_path_factory.mktemp("weights")
    for kind in NETWORKS.values():
        weights = {name: w + 0.1 * random.standard_normal(w.shape, np.float32)
                   for name, w in kind.begun("sixteenth", 3).items()}
        write_network(folder / f"{kind.name}.npz",
                      Network(kind.name, "sixteenth", weights, {"steps": 0}))
    return {name: folder / f"{name}.npz" for name in NETWORKS}


@pytest.fixture(scope="module")
def frames():
    """Three noisy frames in motion that have every channel the method reads."""
    random = np.random.default_rng(5)
    made = [make_frame(HEIGHT, WIDTH, index=i, board=translation(0.2 * i, 0, 0),
                       camera=turn(0.2 + 0.02 * i)) for i in range(3)]
    lamp = np.zeros((HEIGHT, WIDTH, 3))
    lamp[3:7, 5:9] = 4
    return [with_images(f, albedo=random.random((HEIGHT, WIDTH, 3)), emission=lamp,
                        color=noisy(f, i)["color"] + lamp, roughness=random.random((HEIGHT, WIDTH)))
            for i, f in enumerate(made)]


def run(method, frames):
    state = method.init(HEIGHT, WIDTH)
    for frame in frames:
        image, state = method(frame, state)
    return image


def planes_of(frames, kind):
    return np.stack([oracles.padded(oracles.planes_of(f.images, f.camera_from_world),
                                    NETWORKS[kind].alignment) for f in frames])


@each_kind
def test_agrees_with_the_formula_in_float64(kind, files, frames):
    def expected(frames):
        return oracles.denoised(frames, lambda planes: ORACLES[kind](weights, planes),
                                NETWORKS[kind].alignment)

    weights = read_network(files[kind]).weights
    np.testing.assert_allclose(run(METHODS[kind](str(files[kind])), frames), expected(frames),
                               atol=1e-4)
    change = np.abs(expected(frames) - expected(frames[2:])).max()
    assert change > 0.01 if NETWORKS[kind].remembers else change == 0


@each_kind
@pytest.mark.parametrize("layout", [None, "gather"])  # the latter is what a GPU has
def test_the_network_of_kernels_agrees_before_anything_holds_its_result(
        kind, layout, files, frames):
    network, planes = read_network(files[kind]), planes_of(frames, kind)
    stencil = Stencil(planes.shape[1], planes.shape[2], 1, layout=layout)
    pyramid, memory, images = Pyramid.make(stencil, network), [], []
    for image in planes.astype(np.float32):
        lanes = [x + 0 for x in stencil.load(image)]
        found, memory = pyramid(lanes, memory)
        images.append(stencil.image(found))
    expected = np.stack(ORACLES[kind](network.weights, planes))
    assert expected.std() > 0.1
    np.testing.assert_allclose(images, expected, atol=1e-4)


@each_kind
def test_what_is_trained_is_what_denoises(kind, files, frames):
    """JAX's forward pass against the formula, which kernels agree with."""
    jax = pytest.importorskip("jax", reason="JAX is not installed: pip install 'onespp[train]'")
    from onespp.training.forward import forward

    weights, planes = read_network(files[kind]).weights, planes_of(frames[:2], kind)
    with jax.default_matmul_precision("float32"):  # a GPU would take ten bits
        found = jax.jit(lambda w, x: forward(NETWORKS[kind], w, x))(
            weights, planes[None].astype(np.float32))
    np.testing.assert_allclose(found[0], ORACLES[kind](weights, planes), atol=1e-4)


@each_kind
def test_frames_alike_record_once_and_other_weights_compile_nothing(kind, files, frames, tmp_path):
    method = METHODS[kind](str(files[kind]))
    state = method.init(HEIGHT, WIDTH)
    for frame in frames:
        _, state = method(frame, state)
    assert {layer.step.recordings for layer in state.network.layers.values()} == {1}
    other = tmp_path / "other.npz"
    write_network(other, Network(kind, "sixteenth", NETWORKS[kind].begun("sixteenth", 9)))
    assert compiled(lambda: run(METHODS[kind](str(other)), frames)) == 0


@each_kind
def test_shipped_weights_are_small_and_say_what_they_are(kind):
    network = read_network(shipped(kind))
    assert network.width == NETWORKS[kind].width
    assert {"seed", "steps", "data", "versions"} <= set(network.about)
    assert sum(path.stat().st_size for path in shipped(kind).parent.glob("*.npz")) <= 1_000_000


@each_kind
def test_widths_are_shares_of_the_published_one(kind):
    sizes = [sum(np.prod(s) for s in NETWORKS[kind].shapes(width).values()) for width in WIDTHS]
    assert sizes == sorted(sizes, reverse=True)
    a, b = (NETWORKS[kind].begun("sixteenth", seed)[NETWORKS[kind].last] for seed in (0, 1))
    assert not np.array_equal(a, b)


def test_layers_are_those_that_are_published():
    layers, quarter = (NETWORKS["rae"].layers(width) for width in ("full", "quarter"))
    assert [layers[f"down{i}"].outputs for i in range(5)] == [32, 43, 57, 76, 101]
    assert [quarter[f"up{i}.join"].outputs for i in range(5)] == [16, 8, 11, 15, 19]
    layers = NETWORKS["unet"].layers("full")
    assert [layer.outputs for layer in layers.values()] == [32] * 7 + [64] * 5 + [32] * 3 + [3]
    assert [layers[f"dec{i}a"].inputs for i in (4, 3, 2, 1)] == [64, 96, 96, 39]


def test_what_is_no_file_of_weights_is_refused(files, tmp_path):
    with pytest.raises(InputError, match=r"missing\.npz does not exist"):
        build("rae-quarter", {"weights": str(tmp_path / "missing.npz")}).init(8, 8)
    with pytest.raises(InputError, match=r"unet\.npz holds weights of the network unet, and the "
                                         r"method is of rae: use a file that `onespp train rae`"):
        shipped_or(str(files["unet"]), "rae")
    with pytest.raises(InputError, match="there is no network 'unit': use rae, unet"):
        architecture_of("unit")
    good = read_network(files["rae"])
    broken = good.weights | {"up0.out.bias": np.full(3, np.nan, np.float32)}
    for content in (b"", b"text", files["rae"].read_bytes()[:-300],
                    Network("rae", "sixteenth", broken),
                    Network("unet", "sixteenth", good.weights)):
        path = tmp_path / "bad.npz"
        if isinstance(content, Network):
            write_network(path, content)
        else:
            path.write_bytes(content)
        with pytest.raises(InputError, match=r"bad.npz holds no weights.*onespp train"):
            read_network(path, id(content))
