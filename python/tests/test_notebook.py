"""The example notebook runs from its first cell to its last."""

from pathlib import Path

import nbclient
import nbformat

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "notebook"


def test_the_notebook_runs() -> None:
    notebook = nbformat.read(FOLDER / "tour.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(FOLDER)}}).execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pages = [output for output in shown if "<iframe srcdoc=" in output.get("data", {}).get("text/html", "")]
    assert len(pages) == 1
    pictures = [output for output in shown if "image/png" in output.get("data", {})]
    assert len(pictures) == 1
    assert not [output for output in shown if output.output_type == "stream" and output.name == "stderr"]
