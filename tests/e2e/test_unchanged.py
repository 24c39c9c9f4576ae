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
    monkeypatch.setattr(unchanged, "RECORD", tmp_path / "docs/record.json")
    monkeypatch.setattr(unchanged, "PARTS", {"part": ([], ["read"])})
    monkeypatch.delenv("MAKEFLAGS", raising=False)
    for folder in ("read", "docs"):
        (tmp_path / folder).mkdir()
    git(tmp_path, "init", "--quiet")
    write(tmp_path, "read/file", "docs/other", "Makefile")
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


def passes():
    unchanged.Unchanged(["part"]).ran("part", True)


def test_a_part_runs_again_when_something_that_it_reads_has_changed(repository):
    assert entry() is None
    passes()
    revision = subprocess.check_output(["git", "rev-parse", "HEAD"], cwd=repository, text=True)
    assert revision.startswith(entry()["revision"])
    write(repository, "docs/other")
    # The record keeps the revision at which the part passed.
    passes()
    assert revision.startswith(entry()["revision"])
    for path in ("read/file", "read/new", "Makefile", "clippy.toml"):
        write(repository, path)
        assert entry() is None, path
        passes()
        assert entry()
    (repository / "read/not added").touch()
    assert entry() is None
    passes()
    assert entry() is None


def test_runs_that_were_overtaken_are_not_recorded(repository, monkeypatch):
    run = unchanged.Unchanged(["part"])
    write(repository, "read/file")
    run.ran("part", True)
    assert entry() is None
    passes()
    assert entry()
    unchanged.tools.cache_clear()
    monkeypatch.setattr(unchanged, "output", lambda *_: "another compiler")
    assert entry() is None


def test_a_run_that_fails_takes_the_entry_away(repository):
    passes()
    unchanged.Unchanged(["part"]).ran("part", False)
    assert entry() is None


@pytest.mark.parametrize("name, value", [("RUSTFLAGS", "-O"), ("MAKEFLAGS", "w -- CARGO=false PARTS=part")])
def test_other_settings_are_another_state(repository, monkeypatch, name, value):
    passes()
    monkeypatch.setenv("MAKEFLAGS", "w -- PARTS=part STRICT=1")
    assert entry()
    monkeypatch.setenv(name, value)
    assert entry() is None


def test_a_record_that_was_cut_is_no_record(repository, capsys):
    passes()
    text = unchanged.RECORD.read_text()
    unchanged.RECORD.write_text(text[:20])
    assert entry() is None
    assert "all parts run" in capsys.readouterr().out
    passes()
    assert unchanged.RECORD.read_text() == text


def test_parts_exist_and_read_something():
    makefile = (TESTS.parent / "Makefile").read_text()
    parts = " ".join(re.findall(r"^(?:TEST|LONG)_PARTS := (.*)", makefile, re.M)).split()
    for part, (packages, paths) in unchanged.PARTS.items():
        assert part in parts
        for path in (*paths, *(unchanged.folders(packages) if packages else ())):
            assert unchanged.output("git", "ls-files", "--", path), (part, path)
    assert "crates/link" in unchanged.folders(["motorlink-cli"])
    assert "crates/link" not in unchanged.folders(["motorlink-proto"])
