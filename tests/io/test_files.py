"""Files written whole or not at all."""

import os
import stat

import pytest

from dnacheck.io import files
from dnacheck.io.files import atomic_write
from dnacheck.numerics.outcome import InputError

AS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


def names(directory):
    return sorted(path.name for path in directory.iterdir())


@pytest.mark.parametrize(
    ("content", "data"), [("Å\r\nb\n", b"\xc3\x85\r\nb\n"), (b"\0\xff", b"\0\xff"), ("", b"")]
)
def test_content_arrives_unchanged_and_nothing_else_stays(content, data, tmp_path):
    path = tmp_path / "out.txt"
    atomic_write(path, "what was there before")
    atomic_write(path, content)
    assert path.read_bytes() == data
    assert names(tmp_path) == ["out.txt"]


def test_new_file_follows_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        atomic_write(tmp_path / "a", "x")
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o640


def test_existing_permissions_are_kept(tmp_path):
    path = tmp_path / "a"
    path.write_text("old")
    path.chmod(0o600)
    atomic_write(path, "new")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_symbolic_link_stays_a_link(tmp_path):
    target = tmp_path / "target"
    target.write_text("old")
    link = tmp_path / "link"
    link.symlink_to(target)
    atomic_write(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"


@pytest.mark.parametrize("failing", ["fsync", "replace"])
def test_failure_on_the_way_leaves_the_old_file_alone(failing, tmp_path, monkeypatch):
    path = tmp_path / "a"
    path.write_text("old")

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    owner = files.os if failing == "fsync" else files.Path
    monkeypatch.setattr(owner, failing, fail)
    with pytest.raises(InputError, match=r"cannot write .*a': No space left on device"):
        atomic_write(path, "new")
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a"]


def test_interruption_leaves_no_scratch_file(tmp_path, monkeypatch):
    def interrupt(handle):
        raise KeyboardInterrupt

    monkeypatch.setattr(files.os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        atomic_write(tmp_path / "a", "new")
    assert names(tmp_path) == []


@pytest.mark.parametrize("name", ["absent/out.txt", ".", "nul\0byte", "x" * 300, "file/below.txt"])
def test_unwritable_place_is_an_input_error_of_one_line(name, tmp_path):
    (tmp_path / "file").write_text("a file, not a directory")
    with pytest.raises(InputError, match="cannot write") as caught:
        atomic_write(f"{tmp_path}/{name}", "x")
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(AS_ROOT, reason="root may write anywhere")
def test_directory_without_permission(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="Permission denied"):
        atomic_write(tmp_path / "a", "x")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_pipe_is_written_directly(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        atomic_write(path, "through")
        assert os.read(reader, 100) == b"through"
    finally:
        os.close(reader)
    assert stat.S_ISFIFO(path.stat().st_mode)
