"""``rift samples``: what it lists, copies and downloads, and what it refuses."""

import hashlib
import io
import urllib.request
from pathlib import Path
from urllib.error import URLError

import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.samples import download as downloads
from rift_cl.commands.samples.download import download
from rift_cl.errors import InputError, OutputError
from rift_cl.io import open_capture
from rift_cl.sample.open_data import OPEN_DATA

URL = "https://example.org/scan.h5"
DATA = bytes(range(256)) * 40
SHA = hashlib.sha256(DATA).hexdigest()


class Answer(io.BytesIO):
    """What a server sends: all of it, or the rest that it was asked for."""

    def __init__(self, data, status):
        super().__init__(data)
        self.status = status


class Server:
    """A server in this process, which may know no ranges, or break off."""

    def __init__(self, data=DATA, *, ranges=True, most=None):
        self.data, self.ranges, self.most = data, ranges, most
        self.asked = []

    def __call__(self, request):
        begin = request.get_header("Range")
        self.asked.append(begin)
        if begin and self.ranges:
            return Answer(self.data[int(begin[6:-1]) :][: self.most], 206)
        return Answer(self.data[: self.most], 200)


def test_all_are_listed_with_licence_and_address(capsys):
    assert main(["samples"]) == 0
    shown = "".join(capsys.readouterr().out.split())
    for name, data in OPEN_DATA.items():
        assert name in shown and data.sha256 in shown
        assert "".join(data.licence.split()) in shown and (data.url or data.page) in shown
        assert data.url is None or data.url.startswith("https://")
        assert len(data.sha256) == 64


@pytest.mark.each
@pytest.mark.parametrize(("name", "views"), [("wall", 24), ("ornament-off-path", 8)])
def test_a_capture_of_the_package_is_copied_once(name, views, tmp_path, capsys):
    out = tmp_path / "capture"
    # Of a name that a copy in the making might have.
    (tmp_path / "capture.part").mkdir()
    (tmp_path / "capture.part" / "mine").touch()
    out.mkdir()  # an empty folder is as good as none
    assert main(["samples", name, "--out", str(out)]) == 0
    assert len(open_capture(out).views) == views
    assert main(["samples", name, "--out", str(out)]) != 0
    assert "is there already" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["capture", "capture.part"]
    assert (tmp_path / "capture.part" / "mine").exists()


def test_a_file_by_path_is_checked_and_copied(tmp_path, monkeypatch, capsys):
    known = OPEN_DATA["tooth"]._replace(size=len(DATA), sha256=SHA)
    monkeypatch.setitem(OPEN_DATA, "tooth", known)
    given = tmp_path / "given.h5"
    for data, status in ((DATA[:-1], 3), (DATA[::-1], 3), (DATA, 0)):
        given.write_bytes(data)
        words = ["samples", "tooth", "--file", str(given), "--out", str(tmp_path / "data")]
        assert main(words) == status
        assert (tmp_path / "data/tooth.h5").exists() == (status == 0)
    assert (tmp_path / "data/tooth.h5").read_bytes() == DATA
    assert "given.h5" in capsys.readouterr().err


def test_without_a_network_the_remedy_is_named(tmp_path, monkeypatch, capsys):
    def nothing(_):
        raise URLError("no route to host")

    monkeypatch.setattr(downloads, "_open_url", nothing)
    assert main(["samples", "tooth", "--out", str(tmp_path)]) != 0
    assert "--file tooth.h5" in capsys.readouterr().err
    assert main(["samples", "walnut", "--out", str(tmp_path)]) == 3
    assert "--file walnut_cone.npz" in capsys.readouterr().err
    assert main(["samples", "nothing-like-it"]) == 3
    assert "there are ornament" in capsys.readouterr().err


def test_a_download_that_broke_off_goes_on(tmp_path):
    path = tmp_path / "scan.h5"
    with pytest.raises(OutputError, match="early"):
        download(URL, path, len(DATA), SHA, open_url=Server(most=1000))
    assert not path.exists()
    server = Server()
    download(URL, path, len(DATA), SHA, open_url=server)
    assert server.asked == ["bytes=1000-"]
    assert path.read_bytes() == DATA
    assert list(tmp_path.iterdir()) == [path]


class Broken(Answer):
    """An answer whose connection breaks."""

    def read(self, _):
        raise ConnectionResetError("reset by peer")


def test_a_broken_connection_is_no_fault_of_the_disk(tmp_path):
    with pytest.raises(OutputError, match=r"example\.org.*reset by peer") as told:
        download(URL, tmp_path / "a", len(DATA), SHA, open_url=lambda _: Broken(b"", 200))
    assert "a.part" not in str(told.value)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a full disk, on Linux")
def test_a_full_disk_is_no_fault_of_the_connection(tmp_path):
    (tmp_path / "a.part").symlink_to("/dev/full")
    with pytest.raises(OutputError, match=r"a\.part: cannot be written") as told:
        download(URL, tmp_path / "a", len(DATA), SHA, open_url=Server())
    assert "example.org" not in str(told.value)


def test_a_server_without_ranges_begins_anew(tmp_path):
    path = tmp_path / "scan.h5"
    (tmp_path / "scan.h5.part").write_bytes(b"x" * 1000)
    download(URL, path, len(DATA), SHA, open_url=Server(ranges=False))
    assert path.read_bytes() == DATA


@pytest.mark.each
@pytest.mark.parametrize("sent", [DATA[::-1], DATA * 2], ids=["other", "longer"])
def test_another_file_is_not_kept(sent, tmp_path):
    with pytest.raises(InputError):
        download(URL, tmp_path / "scan.h5", len(DATA), SHA, open_url=Server(sent))
    assert list(tmp_path.iterdir()) == []


def test_https_alone_is_fetched(tmp_path):
    with pytest.raises(InputError, match="https"):
        download("http://example.org/a", tmp_path / "a", 1, SHA, open_url=Server())
    handler = downloads._HttpsAlone()
    request = urllib.request.Request(URL)
    with pytest.raises(InputError, match="https"):
        handler.redirect_request(request, None, 302, "", {}, "http://example.org/a")
    assert handler.redirect_request(request, None, 302, "", {}, "https://example.org/a")
