"""What tev gets, by a server that speaks its protocol: names, sizes and every pixel."""

from __future__ import annotations

import socket
import struct
import sys
import threading

import numpy as np
import pytest

from onespp.denoise.report import tev
from onespp.denoise.report.contact_sheets import display_error
from onespp.render.errors import InputError
from tests.support.made_sequence import HEIGHT, WIDTH, make_sequence


class Tev:
    """Takes one connection, and makes images of its packets."""

    def __init__(self) -> None:
        self.images: dict[str, np.ndarray] = {}
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def close(self) -> dict[str, np.ndarray]:
        self._thread.join(20)
        self._server.close()
        return self.images

    def _serve(self) -> None:
        with self._server.accept()[0] as connection, connection.makefile("rb") as stream:
            while head := stream.read(4):
                self._take(stream.read(struct.unpack("<I", head)[0] - 4))

    def _take(self, packet: bytes) -> None:
        kind, _, rest = packet[0], packet[1], packet[2:]
        name, rest = rest.split(b"\0", 1)
        key = name.decode()
        if kind == 4:
            w, h, count = struct.unpack_from("<3i", rest)
            channels = rest[12:].split(b"\0")
            assert channels == [*{3: [b"R", b"G", b"B"], 1: [b"Y"]}[count], b""]
            self.images[key] = np.full((h, w, count), np.nan, np.float32)
            return
        assert kind == 6
        count = struct.unpack_from("<i", rest)[0]
        *_, rest = rest[4:].split(b"\0", count)
        x, y, w, h = struct.unpack_from("<4i", rest)
        numbers = struct.unpack_from(f"<{2 * count}q", rest, 16)
        pixels = np.frombuffer(rest, "<f4", offset=16 + 16 * count)
        assert len(pixels) == w * h * count
        for c, (offset, stride) in enumerate(zip(numbers[:count], numbers[count:])):
            self.images[key][y:y + h, x:x + w, c] = pixels[offset::stride].reshape(h, w)


@pytest.fixture
def server():
    listening = Tev()
    yield listening
    with socket.create_connection(("127.0.0.1", listening.port)) if listening._thread.is_alive() \
            else socket.socket():
        pass
    listening.close()


def test_every_image_arrives_under_its_name(tmp_path, server, call):
    sequence = make_sequence(tmp_path / "made")
    code, out, _ = call("view", sequence.folder, "--tev", f"127.0.0.1:{server.port}")
    assert code == 0
    assert out == f"sent 24 images to tev at 127.0.0.1:{server.port}\n"
    images = server.close()
    assert list(images)[:6] == [f"made/0000/{what}" for what in (
        "input", "fine", "fine error", "rough", "rough error", "reference")]
    assert len(images) == 24
    reference, fine = sequence.read_reference(2).color, sequence.read_result("fine", 2)
    np.testing.assert_array_equal(images["made/0002/reference"], reference)
    np.testing.assert_array_equal(images["made/0002/fine"], fine)
    np.testing.assert_array_equal(images["made/0002/input"], sequence.read_frame(2)["color"])
    np.testing.assert_array_equal(images["made/0002/fine error"][..., 0],
                                  display_error(fine, reference).astype(np.float32))


def test_methods_and_frames_can_be_chosen(tmp_path, server, call):
    folder = make_sequence(tmp_path / "made", reference=False).folder
    assert call("view", folder, "--method", "rough", "--frames", "1,3", "--tev",
                f"127.0.0.1:{server.port}")[0] == 0
    assert list(server.close()) == ["made/0001/input", "made/0001/rough",
                                    "made/0003/input", "made/0003/rough"]


def test_an_image_larger_than_a_packet_is_whole(server):
    image = np.random.default_rng(0).random((2 * tev._ROWS + 5, 40, 3)).astype(np.float32)
    with socket.create_connection(("127.0.0.1", server.port)) as connection:
        for packet in tev.packets("a/é 1", image):
            connection.sendall(packet)
    np.testing.assert_array_equal(server.close()["a/é 1"], image)


@pytest.mark.skipif(sys.version_info < (3, 11), reason="tevclient asks for Python 3.11")
def test_packets_are_those_of_tevclient():
    theirs = pytest.importorskip("tevclient").packet
    image = np.random.default_rng(0).random((HEIGHT, WIDTH, 3)).astype(np.float32)
    create, update = tev.packets("a", image)
    assert create == theirs.create_image("a", WIDTH, HEIGHT, ["R", "G", "B"], grab_focus=False)
    assert update == theirs.update_image("a", image, ["R", "G", "B"])


def test_where_no_tev_listens_a_sentence_says_what_to_do(tmp_path, call):
    folder = make_sequence(tmp_path / "made").folder
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    code, out, words = call("view", folder, "--tev", f"127.0.0.1:{port}")
    assert (code, out) == (2, "")
    assert words == (f"onespp: no tev listens at 127.0.0.1:{port}: start tev, then run the same "
                     "command again, or say where it is by --tev HOST:PORT\n")


def test_a_tev_that_goes_away_is_told(tmp_path, monkeypatch):
    sequence = make_sequence(tmp_path / "made")
    monkeypatch.setattr(tev, "packets", lambda name, image: [bytes(1 << 24)] * 4)
    with socket.create_server(("127.0.0.1", 0)) as server:
        def end() -> None:
            server.accept()[0].close()

        thread = threading.Thread(target=end)
        thread.start()
        with pytest.raises(InputError, match="went away after 1 images"):
            tev.view(sequence, port=server.getsockname()[1], host="127.0.0.1")
        thread.join()


@pytest.mark.parametrize(("arguments", "words"), [
    (["--method", "none"], "no results of 'none': it has fine, rough; make some"),
    (["--frames", "9"], "no frame 9: it has 0 to 3"),
    (["--tev", "here"], "--tev is 'here': use HOST:PORT"),
    (["--tev", "here:99999"], "--tev is 'here:99999': use HOST:PORT")])
def test_what_is_not_there_is_named(tmp_path, call, arguments, words):
    code, _, said = call("view", make_sequence(tmp_path / "made").folder, *arguments)
    assert code == 2
    assert words in said
    assert said.count("\n") == 1
