"""Simulate from the command line, then read what was written: fields, report, times."""

import json
import subprocess
import sys
import xml.etree.ElementTree
from pathlib import Path

import meshio
import numpy as np

folder = Path("out")
command = [sys.executable, "-m", "palpate.cli", "simulate", "small", "--output", str(folder)]
subprocess.run([*command, "--duration", "0.25", "--every", "5", "--no-pictures"], check=True)

# The index names a file for each time; every file holds all bodies.
index = xml.etree.ElementTree.parse(folder / "simulation.pvd")
for entry in index.iter("DataSet"):
    frame = meshio.read(folder / entry.attrib["file"])
    moved = np.linalg.norm(frame.point_data["displacement"], axis=1).max()
    pressed = np.linalg.norm(frame.point_data["contact_force"], axis=1).max()
    time = float(entry.attrib["timestep"])
    print(f"t = {time:.3f} s: moved by {1e3 * moved:5.1f} mm, largest nodal force {pressed:.3f} N")

report = json.loads((folder / "report.json").read_text())
print("frames:", report["frame_count"], " wall time:", f"{report['wall_time']:.2f} s")
