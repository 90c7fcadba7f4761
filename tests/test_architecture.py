"""Dependencies among the crates point one way."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent

#: What each crate may use of ours.
ALLOWED = {
    "palpate-geometry": set(),
    "palpate-model": {"palpate-geometry"},
    "palpate-cutting": {"palpate-geometry", "palpate-model"},
    "palpate-contact": {"palpate-geometry", "palpate-model"},
    "palpate-solver": set(),
    "palpate-mechanics": {
        "palpate-geometry",
        "palpate-model",
        "palpate-contact",
        "palpate-solver",
    },
    "palpate": {
        "palpate-geometry",
        "palpate-model",
        "palpate-cutting",
        "palpate-contact",
        "palpate-mechanics",
    },
    "palpate-python": {"palpate"},
    "palpate-testing": set(),
    "palpate-fuzz": {"palpate", "palpate-testing"},
}


#: METIS is called through its C interface; SIMD intrinsics stand in one file; tests count
#: memory.
UNSAFE = {"metis.rs", "simd.rs", "counting_allocator.rs"}


def test_crates_depend_one_way():
    for crate, allowed in ALLOWED.items():
        manifest = (ROOT / "crates" / crate / "Cargo.toml").read_text()
        section = manifest.split("[dependencies]")[1].split("\n[")[0]
        used = set(re.findall(r"^(palpate[a-z-]*)\b", section, re.MULTILINE))
        assert used <= allowed, crate


def test_every_crate_is_listed():
    assert {path.name for path in (ROOT / "crates").iterdir()} == set(ALLOWED)


def test_unsafe_stays_out():
    for source in (ROOT / "crates").glob("*/src/**/*.rs"):
        code = re.sub(r"//.*", "", source.read_text())
        assert not re.search(r"\bunsafe\b", code) or source.name in UNSAFE, source


def test_promises_are_held_where_the_page_says():
    page = (ROOT / "ARCHITECTURE.md").read_text("utf-8")
    rows = re.findall(r"^\| [^|]+ \| `([^`|]+)` \| ([^|]+) \|$", page, re.MULTILINE)
    assert len(rows) > 20
    for path, tests in rows:
        code = (ROOT / path).read_text("utf-8")
        names = re.findall(r"`(\w+)`", tests)
        assert names, path
        for name in names:
            assert re.search(rf"\b(fn|def) {name}\b", code), f"{path}: {name}"


def test_files_that_the_page_names_exist():
    page = (ROOT / "ARCHITECTURE.md").read_text("utf-8")
    for path in set(re.findall(r"`((?:palpate|python|tests)[\w./-]*/[\w./-]+)`", page)):
        places = [ROOT / path, ROOT / "crates" / path]
        assert any(each.exists() for each in places), path


def test_one_version_everywhere():
    workspace = (ROOT / "Cargo.toml").read_text("utf-8")
    version = re.search(r'^version = "([^"]+)"$', workspace, re.MULTILINE)[1]
    ours = re.findall(
        r'^palpate[\w-]* = \{ path = "[^"]+", version = "([^"]+)" \}$', workspace, re.M
    )
    assert set(ours) == {version}
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"\n## [{version}] - 20" in (ROOT / "CHANGELOG.md").read_text("utf-8")
    rust = re.search(r'^rust-version = "([^"]+)"$', workspace, re.MULTILINE)[1]
    for page in ("README.md", "CONTRIBUTING.md", "docs/installation.md", ".ci/run"):
        assert re.search(rf"\b{re.escape(rust)}\b", (ROOT / page).read_text("utf-8")), page


def test_notices_are_of_what_is_linked():
    lock = (ROOT / "Cargo.lock").read_text("utf-8")
    locked = set(re.findall(r'^name = "([^"]+)"\nversion = "([^"]+)"$', lock, re.MULTILINE))
    notices = (ROOT / "LICENSE-THIRD-PARTY").read_text("utf-8")
    named = set(re.findall(r"^  ([\w-]+) (\d[\w.+-]*)$", notices, re.MULTILINE))
    assert named <= locked, "`make licences` writes them anew"
    for crate in set(ALLOWED) - {"palpate-testing", "palpate-fuzz"}:
        manifest = (ROOT / "crates" / crate / "Cargo.toml").read_text("utf-8")
        section = manifest.split("[dependencies]")[1].split("\n[")[0]
        used = set(re.findall(r"^([a-z][\w-]*)\b", section, re.MULTILINE))
        assert used <= {name for name, _ in named}, crate
