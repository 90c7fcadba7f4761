"""Every example in README and docs runs: Python blocks, commands after a `$`, and examples/.

A page's blocks run in their order in one folder; a ``bml`` block whose first line is a comment
``// name.bml`` is written there.
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(
    [ROOT / "README.md", *(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)]
)
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
#: What a page needs beyond the package itself.
NEEDS = {"first_hour.md": ("wildmeshing", "nibabel")}


def blocks(page):
    """Language and text of the blocks of a page, in order."""
    return re.findall(r"^```(python|console|bml)\n(.*?)^```", page.read_text(), re.M | re.S)


def run_command(line, folder):
    binaries = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{binaries}{os.pathsep}{os.environ['PATH']}"}
    # A few frames are enough to see that a command works.
    command = re.sub(r"(palpate simulate \S+)( --duration \S+)?", r"\1 --duration 0.05", line)
    if "palpate simulate" in command:
        command += " --no-pictures"
    done = subprocess.run(
        shlex.split(command),
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_run(page, tmp_path, monkeypatch):
    for module in NEEDS.get(page.name, ()):
        pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models").symlink_to(ROOT / "models")
    namespace = {}
    for language, text in blocks(page):
        if language == "python":
            exec(compile(text, str(page), "exec"), namespace)
        elif language == "console":
            for line in text.splitlines():
                if line.startswith("$ palpate"):
                    run_command(line[2:], tmp_path)
        elif name := re.match(r"// (\S+\.bml)\n", text):
            (tmp_path / name[1]).write_text(text)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_examples_run(example, tmp_path):
    done = subprocess.run(
        [sys.executable, str(example)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_links_between_pages_lead_somewhere():
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page}: {target}"


def test_there_is_something_to_run():
    languages = [language for page in PAGES for language, _ in blocks(page)]
    assert {"python", "console", "bml"} <= set(languages)
    assert EXAMPLES
