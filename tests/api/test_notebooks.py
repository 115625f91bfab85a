"""The notebooks of the documentation run in a kernel, and are stored without what they print."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from onespp.api import caller

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs/notebooks").glob("*.ipynb"))
nbclient = pytest.importorskip(
    "nbclient", reason="nbclient is not installed: pip install -e '.[dev]'")
nbformat = pytest.importorskip("nbformat")


def outputs(notebook, kind: str) -> list[str]:
    """The outputs of one MIME type."""
    return ["".join(out["data"][kind]) for cell in notebook.cells for out in cell.get("outputs", ())
            if kind in out.get("data", {})]


@pytest.fixture(scope="module")
def run():
    """Runs a notebook, each once."""
    done = {}

    def execute(name: str):
        if name not in done:
            path = next(p for p in NOTEBOOKS if p.stem == name)
            notebook = nbformat.read(path, as_version=4)
            nbformat.validate(notebook)
            nbclient.NotebookClient(notebook, timeout=300).execute()
            done[name] = notebook
        return done[name]

    return execute


def test_there_are_two():
    assert [path.stem for path in NOTEBOOKS] == ["first_steps", "own_filter"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_they_are_stored_without_outputs(path: Path):
    for cell in json.loads(path.read_text("utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None


def test_first_steps(run):
    notebook = run("first_steps")
    shown = outputs(notebook, "text/html")
    assert [kind for kind in ('type="range"', "<b>frame 5</b>", "<table>", "<iframe srcdoc=")
            if any(kind in text for text in shown)] == [
        'type="range"', "<b>frame 5</b>", "<table>", "<iframe srcdoc="]
    assert any("((96, 128, 3), np.True_)" in text for text in outputs(notebook, "text/plain"))


@pytest.mark.slow
def test_a_filter_of_ones_own(run):
    notebook = run("own_filter")
    table = next(text for text in outputs(notebook, "text/html") if "<table>" in text)
    assert "WindowMean" in table
    tried = eval(outputs(notebook, "text/plain")[-1])
    assert tried["input"] + 5 < tried["WindowMean"] < tried["svgf"]
    assert tried["WindowMean"] == tried["alpha-0.3"]


def test_progress_in_a_kernel_is_a_line_of_the_cells_output(run):
    """Without a word on standard error, which notebooks show in red."""
    printed = [out for cell in run("first_steps").cells for out in cell.get("outputs", ())
               if out["output_type"] == "stream"]
    assert {out["name"] for out in printed} == {"stdout"}
    assert any("denoise svgf: 6 of 6" in out["text"] for out in printed)


def test_a_kernel_is_told_from_a_terminal(monkeypatch):
    class ZMQInteractiveShell:
        pass

    for shell, expected in ((ZMQInteractiveShell(), True), (object(), False), (None, False)):
        monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda s=shell: s))
        assert caller.in_notebook() is expected
    monkeypatch.delitem(sys.modules, "IPython")
    assert not caller.in_notebook()


@pytest.fixture
def kernel():
    """`run(code)` gives a cell's printed text and the name of its error; `interrupt()` as the
    button does."""
    from jupyter_client.manager import start_new_kernel

    manager, client = start_new_kernel()

    def run(code: str, during=lambda: None) -> tuple[str, str | None]:
        printed, seen = "", False

        def hook(message) -> None:
            nonlocal printed, seen
            if message["msg_type"] == "stream":
                printed += message["content"]["text"]
                if not seen and "reference" in printed:
                    seen = True
                    during()

        reply = client.execute_interactive(code, timeout=300, output_hook=hook)["content"]
        return printed, reply.get("ename")

    yield run, manager.interrupt_kernel
    client.stop_channels()
    manager.shutdown_kernel(now=True)


def test_the_stop_button_leaves_the_kernel_usable(kernel, tmp_path):
    run, interrupt = kernel
    render = f"s = onespp.render('box', r'{tmp_path}/s', frames=2, size=(96, 128)"
    printed, error = run(f"import onespp\n{render}, reference_spp=1 << 20)", interrupt)
    assert error == "KeyboardInterrupt"
    assert "reference" in printed
    printed, error = run(f"{render})\nonespp.denoise(s, 'svgf')\nprint(s.methods())")
    assert error is None
    assert "['svgf']" in printed
