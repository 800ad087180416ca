"""Runs a notebook from top to bottom and keeps it with what its cells put out, for the page of the site.

    python benchmarks/notebook.py docs/start/quickstart.ipynb [-o OTHER.ipynb]

The kernel is the Python that runs this, with whatever diff3ds that has; files go to a folder that is gone afterwards.
Needs the packages nbclient and ipykernel. The state of widgets, which holds whole pages, is not kept.
"""

import argparse
import tempfile
import time
from pathlib import Path

import nbclient
import nbformat

# Seconds that a cell may take: ten times what the longest does on two idle cores.
PATIENCE = 300
WIDGET = "application/vnd.jupyter.widget-view+json"


def executed(path: Path) -> nbformat.NotebookNode:
    """The notebook with the outputs of a run; an error of a cell is raised."""
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        client = nbclient.NotebookClient(
            notebook, timeout=PATIENCE, kernel_name="python3", resources={"metadata": {"path": folder}}
        )
        client.execute()
    notebook.metadata.pop("widgets", None)
    notebook.metadata["language_info"] = {"name": "python"}
    for cell in notebook.cells:
        # When it ran, which differs with every run.
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if WIDGET in data:
                output["data"] = {"text/plain": "(a widget, which pages and files cannot show)"}
            elif "image/png" in data:
                # Else all numbers of a sketch.
                output["data"] = {"image/png": data["image/png"]}
    return notebook


def main() -> None:
    """Runs one notebook."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("notebook", type=Path)
    parser.add_argument("-o", "--out", type=Path, help="by default the notebook itself")
    chosen = parser.parse_args()
    begun = time.perf_counter()
    done = executed(chosen.notebook)
    nbformat.write(done, chosen.out or chosen.notebook)
    print(f"{chosen.notebook.name}: {time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
