"""The recurrent autoencoder: its formulas in float64, what is trained and what denoises alike."""

import numpy as np
import pytest

from onespp.denoise.catalog import build
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.recurrent.architecture import WIDTHS, begun, layers, shapes
from onespp.denoise.methods.recurrent.network import Autoencoder
from onespp.denoise.methods.recurrent.rae import Rae
from onespp.denoise.methods.recurrent.weights import (
    SHIPPED,
    Network,
    read_network,
    write_network,
)
from onespp.denoise.oracles import rae as oracles
from onespp.render.errors import InputError
from tests.support.frames import make_frame, noisy, translation, turn, with_images
from tests.support.recordings import compiled

HEIGHT, WIDTH = 40, 37  # padded to 64x64: mirrored by more than half of it


@pytest.fixture(scope="module")
def weights_file(tmp_path_factory):
    """Of the narrowest network, not trained, with biases."""
    random = np.random.default_rng(4)
    weights = {name: w + 0.1 * random.standard_normal(w.shape, np.float32)
               for name, w in begun("sixteenth", 3).items()}
    path = tmp_path_factory.mktemp("weights") / "tiny.npz"
    write_network(path, Network("sixteenth", weights, {"steps": 0}))
    return path


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


def planes_of(frames):
    return np.stack([oracles.padded(oracles.planes_of(f.images, f.camera_from_world))
                     for f in frames])


def test_agrees_with_the_formula_in_float64(weights_file, frames):
    weights = read_network(weights_file).weights
    expected = oracles.rae(frames, weights)
    np.testing.assert_allclose(run(Rae(str(weights_file)), frames), expected, atol=1e-4)
    assert np.abs(expected - oracles.rae(frames[2:], weights)).max() > 0.01  # it remembers


def test_the_network_of_kernels_agrees_before_anything_holds_its_result(weights_file, frames):
    network, planes = read_network(weights_file), planes_of(frames)
    stencil = Stencil(planes.shape[1], planes.shape[2], 1)
    autoencoder, memory, images = Autoencoder.make(stencil, network), [], []
    for image in planes.astype(np.float32):
        lanes = [x + 0 for x in stencil.load(image)]
        found, memory = autoencoder(lanes, memory)
        images.append(stencil.image(found))
    expected = np.stack(oracles.forward(network.weights, planes))
    assert expected.std() > 0.1
    np.testing.assert_allclose(images, expected, atol=1e-4)


def test_what_is_trained_is_what_denoises(weights_file, frames):
    """JAX's forward pass against the formula, which kernels agree with."""
    jax = pytest.importorskip("jax", reason="JAX is not installed: pip install 'onespp[train]'")
    from onespp.training.network import forward

    weights, planes = read_network(weights_file).weights, planes_of(frames[:2])
    found = jax.jit(forward)(weights, planes[None].astype(np.float32))
    np.testing.assert_allclose(found[0], oracles.forward(weights, planes), atol=1e-4)


def test_frames_alike_record_once_and_other_weights_compile_nothing(weights_file, frames, tmp_path):
    state = Rae(str(weights_file)).init(HEIGHT, WIDTH)
    for frame in frames:
        _, state = Rae(str(weights_file))(frame, state)
    assert {layer.step.recordings for layer in state.network.layers.values()} == {1}
    other = tmp_path / "other.npz"
    write_network(other, Network("sixteenth", begun("sixteenth", 9)))
    assert compiled(lambda: run(Rae(str(other)), frames)) == 0


def test_shipped_weights_are_small_and_say_what_they_are():
    network = read_network(SHIPPED)
    assert SHIPPED.stat().st_size <= 1_000_000
    assert network.width == "quarter"
    assert {"seed", "steps", "data", "versions"} <= set(network.about)


def test_widths_are_shares_of_the_published_one():
    assert [layers("full")[f"down{i}"][1] for i in range(5)] == [32, 43, 57, 76, 101]
    assert [layers("quarter")[f"up{i}.join"][1] for i in range(5)] == [16, 8, 11, 15, 19]
    sizes = [sum(np.prod(s) for s in shapes(width).values()) for width in WIDTHS]
    assert sizes == sorted(sizes, reverse=True)


def test_what_is_no_file_of_weights_is_refused(weights_file, tmp_path):
    with pytest.raises(InputError, match=r"missing\.npz does not exist"):
        build("rae-quarter", {"weights": str(tmp_path / "missing.npz")}).init(8, 8)
    broken = read_network(weights_file).weights | {"up0.out.bias": np.full(3, np.nan, np.float32)}
    for content in (b"", b"text", weights_file.read_bytes()[:-300], broken):
        path = tmp_path / "bad.npz"
        if isinstance(content, dict):
            write_network(path, Network("sixteenth", content))
        else:
            path.write_bytes(content)
        with pytest.raises(InputError, match=r"bad.npz holds no weights.*onespp train rae"):
            read_network(path, len(str(content)))
