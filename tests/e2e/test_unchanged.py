"""Which parts of `make test` need not run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
sys.path.insert(0, str(TESTS))

import unchanged  # noqa: E402


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """A repository with one part, which reads the folder `read`."""
    monkeypatch.setattr(unchanged, "REPOSITORY", tmp_path)
    monkeypatch.setattr(unchanged, "RECORD", tmp_path / "record.json")
    monkeypatch.setattr(unchanged, "PARTS", {"part": ([], ["read"])})
    (tmp_path / "read").mkdir()
    git(tmp_path, "init", "--quiet")
    write(tmp_path, "read/file", "other", "Makefile")
    return tmp_path


def git(folder, *words):
    who = ("-c", "user.name=test", "-c", "user.email=test@localhost")
    subprocess.run(["git", *who, *words], cwd=folder, check=True)


def write(folder, *paths):
    for path in paths:
        with (folder / path).open("a") as file:
            file.write("more\n")
    git(folder, "add", *paths)
    git(folder, "commit", "--quiet", "--message", "more")


def entry():
    return unchanged.Unchanged(["part", "another"]).entry("part")


def passes(*skipped):
    unchanged.Unchanged(["part"]).passed("part", list(skipped))


def test_a_part_runs_again_when_something_that_it_reads_has_changed(repository):
    assert entry() is None
    passes()
    revision = subprocess.check_output(["git", "rev-parse", "HEAD"], cwd=repository, text=True)
    assert revision.startswith(entry()["revision"])
    write(repository, "other")
    # The record keeps the revision at which the part passed.
    passes()
    assert revision.startswith(entry()["revision"])
    for path in ("read/file", "read/new", "Makefile"):
        write(repository, path)
        assert entry() is None, path
        passes()
        assert entry()
    (repository / "read/not added").touch()
    assert entry() is None
    passes()
    assert entry() is None


def test_runs_that_skip_or_that_were_overtaken_are_not_recorded(repository, monkeypatch):
    passes("SKIPPED: miri: it cannot be installed")
    assert entry() is None
    run = unchanged.Unchanged(["part"])
    write(repository, "read/file")
    run.passed("part", [])
    assert entry() is None
    passes("SKIPPED: advisories: no network")
    assert entry()["skipped"] == ["SKIPPED: advisories: no network"]
    monkeypatch.setattr(unchanged, "output", lambda *_: "another compiler")
    assert entry() is None


def test_parts_exist_and_read_something():
    makefile = (TESTS.parent / "Makefile").read_text()
    parts = re.search(r"^ALL_PARTS := (.*)", makefile, re.M)[1].split()
    for part, (packages, paths) in unchanged.PARTS.items():
        assert part in parts
        for path in (*paths, *(unchanged.folders(packages) if packages else ())):
            assert unchanged.output("git", "ls-files", "--", path), (part, path)
    assert "crates/link" in unchanged.folders(["motorlink-cli"])
    assert "crates/link" not in unchanged.folders(["motorlink-proto"])
