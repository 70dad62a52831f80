"""Executes a notebook, writes it with its outputs, and its pictures beside it."""

import base64
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

source, target = map(Path, sys.argv[1:])
notebook = nbformat.read(source, as_version=4)
NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": source.parent}}).execute()
nbformat.write(notebook, target)
pictures = 0
for cell in notebook.cells:
    for output in cell.get("outputs", ()):
        if "image/png" in output.get("data", ()):
            pictures += 1
            picture = base64.b64decode(output.data["image/png"])
            target.with_name(f"{target.stem}-{pictures}.png").write_bytes(picture)
print(f"{target}: {len(notebook.cells)} cells executed, {pictures} pictures")
