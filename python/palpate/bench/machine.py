"""Where and when results were measured."""

from __future__ import annotations

import datetime
import os
import platform
import re
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _core


def describe() -> dict[str, Any]:
    """Processor, cores, memory, system, versions and date; no name of the host or the user."""
    cpu = _cpu()
    return {
        "cpu": cpu["model"],
        "cpu_family_model": cpu["family"],
        "cores": os.cpu_count(),
        "memory_bytes": _memory(),
        "caches": _caches(),
        "simd": cpu["simd"],
        "system": f"{platform.system()} {platform.machine()}",
        "versions": {
            "palpate": _core.__version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
        },
        "date": datetime.datetime.now(datetime.timezone.utc).date().isoformat(),
    }


def slug(machine: dict[str, Any]) -> str:
    """A folder name for a machine's results, from its processor."""
    name = str(machine["cpu"])
    if not re.search(r"\d", name) and machine["cpu_family_model"]:
        name += f" family {machine['cpu_family_model'][0]} model {machine['cpu_family_model'][1]}"
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-") or "unknown"


def sentence(machine: dict[str, Any]) -> str:
    """The machine in words, for the top of a report."""
    family = machine["cpu_family_model"]
    cpu = machine["cpu"] + (f" (family {family[0]}, model {family[1]})" if family else "")
    memory = machine["memory_bytes"]
    parts = [
        cpu,
        f"{machine['cores']} cores",
        f"{memory / 2**30:.0f} GiB" if memory else "",
        ", ".join(f"{name} {size}" for name, size in machine["caches"].items()),
        " ".join(machine["simd"]),
        machine["system"],
        ", ".join(f"{name} {version}" for name, version in machine["versions"].items()),
        machine["date"],
    ]
    return "; ".join(part for part in parts if part)


def _cpu() -> dict[str, Any]:
    text = _read(Path("/proc/cpuinfo"))
    fields = dict(re.findall(r"^([\w ]+?)\s*:\s*(.*)$", text, re.MULTILINE))
    flags = set(fields.get("flags", "").split())
    return {
        "model": fields.get("model name", platform.processor() or platform.machine()),
        "family": [fields["cpu family"], fields["model"]]
        if {"cpu family", "model"} <= fields.keys()
        else None,
        "simd": [name for name in ("avx2", "avx512f") if name in flags],
    }


def _memory() -> int | None:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


def _caches() -> dict[str, str]:
    found = {}
    for folder in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        kind, level, size = (_read(folder / name).strip() for name in ("type", "level", "size"))
        if kind != "Instruction" and size:
            found[f"L{level}"] = f"{size[:-1]} KiB" if size.endswith("K") else size
    return found


def _read(path: Path) -> str:
    try:
        return path.read_text(errors="replace")
    except OSError:
        return ""
