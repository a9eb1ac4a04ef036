"""Finding the public recordings: the order of places, the SHA-256, and what is said when there is nothing."""

import functools
import hashlib
import http.server
import threading

import pooch
import pytest

from snarelab.errors import InputError
from snarelab.recordings import find, find_recording

CONTENT = b"the published bytes"
NAME = "DATA_EMPS.mat"


@pytest.fixture(autouse=True)
def nowhere(tmp_path, monkeypatch):
    """A machine that has no recordings, an empty cache, and a publisher that does not answer."""
    (tmp_path / "project").mkdir()
    monkeypatch.chdir(tmp_path / "project")
    monkeypatch.delenv("SNARELAB_RECORDINGS", raising=False)
    monkeypatch.setattr(pooch, "os_cache", lambda project: tmp_path / "cache" / project)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setattr(find, "PUBLISHER", "http://127.0.0.1:9/")
    monkeypatch.setattr(find, "SHA256", {NAME: hashlib.sha256(CONTENT).hexdigest()})


def put(folder, content=CONTENT):
    (folder / "emps").mkdir(parents=True)
    (folder / "emps" / NAME).write_bytes(content)
    return folder / "emps" / NAME


@pytest.fixture
def publisher(tmp_path, monkeypatch):
    """A publisher on this machine; yields the folder that it serves."""
    folder = tmp_path / "published"
    folder.mkdir()

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, format, *args):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        monkeypatch.setattr(find, "PUBLISHER", f"http://127.0.0.1:{server.server_address[1]}/")
        yield folder
        server.shutdown()


def test_folder_of_the_environment_comes_first(tmp_path, monkeypatch):
    put(tmp_path / "shared" / "recordings")
    mine = put(tmp_path / "mine")
    monkeypatch.setenv("SNARELAB_RECORDINGS", str(tmp_path / "mine"))
    assert find_recording(NAME) == mine


def test_shared_folder_comes_next(tmp_path, monkeypatch):
    monkeypatch.setenv("SNARELAB_RECORDINGS", str(tmp_path / "empty"))
    shared = put(tmp_path / "shared" / "recordings")
    assert find_recording(NAME).resolve() == shared


def test_other_bytes_are_refused(tmp_path):
    put(tmp_path / "shared" / "recordings", b"other bytes")
    with pytest.raises(InputError, match=r"SHA-256 .* is not the published"):
        find_recording(NAME)


def test_fetched_once_then_kept(publisher, tmp_path):
    (publisher / NAME).write_bytes(CONTENT)
    path = find_recording(NAME)
    assert path.read_bytes() == CONTENT
    assert tmp_path / "cache" in path.parents
    (publisher / NAME).unlink()
    assert find_recording(NAME) == path


def test_other_bytes_from_the_publisher_are_refused(publisher, tmp_path):
    (publisher / NAME).write_bytes(b"other bytes")
    with pytest.raises(InputError, match="SHA-256 differs"):
        find_recording(NAME)
    assert not [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]


def test_nothing_anywhere(tmp_path, monkeypatch):
    monkeypatch.setenv("SNARELAB_RECORDINGS", str(tmp_path / "empty"))
    with pytest.raises(InputError) as caught:
        find_recording(NAME)
    line = str(caught.value)
    assert "\n" not in line
    for place in (tmp_path / "empty" / "emps", "shared/recordings/emps", "http://127.0.0.1:9/", "SNARELAB_RECORDINGS"):
        assert str(place) in line


def test_missing_at_the_publisher(publisher):
    with pytest.raises(InputError, match="cannot be had"):
        find_recording(NAME)


def test_unknown_name():
    with pytest.raises(InputError, match=r"'DATA_EMSP\.mat' is not a known one; nearest is 'DATA_EMPS\.mat'"):
        find_recording("DATA_EMSP.mat")
