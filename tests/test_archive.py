"""Archives of runs: what goes in comes out bit for bit, and nothing else is believed."""

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records import archive
from msgdrop_cli.records.archive import FILES, MANIFEST, contents, install, pack, unpack
from msgdrop_cli.records.seals import seal
from msgdrop_cli.records.store import RunRecord, list_runs
from tests.fake_runs import write_run

_Members = dict[str, bytes]


def trained(root: Path, variant: str, seed: int, policy: bytes = b"weights") -> RunRecord:
    """A run with a policy."""
    record = write_run(root, variant, seed, catches={0.0: 3})
    (record.path / "policy.safetensors").write_bytes(policy)
    return record


def packed(folder: Path, *seeds: int) -> Path:
    """An archive of some runs."""
    records = [trained(folder / "there", "dcc", seed) for seed in seeds or (1,)]
    [path] = pack(records, folder, "question-quick")
    return path


def members(path: Path) -> _Members:
    """Names and contents of a zip."""
    with zipfile.ZipFile(path) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def zipped(path: Path, files: Mapping[Any, bytes]) -> Path:
    """Somebody else's zip."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in files.items():
            made.writestr(name, content, compress_type=zipfile.ZIP_DEFLATED)
    return path


def sealed(path: Path, change: Callable[[dict[str, Any], _Members], None]) -> Path:
    """The archive with something changed by who knows how to seal a manifest."""
    files = members(path)
    manifest = json.loads(files[MANIFEST])
    del manifest["seal"]
    change(manifest, files)
    manifest["seal"] = seal(manifest)
    return zipped(path, {**files, MANIFEST: json.dumps(manifest).encode()})


def refused(path: Path, folder: Path) -> str:
    """Why an archive is refused; nothing has been written by then."""
    folder.mkdir()
    with pytest.raises(RecordError) as caught:
        unpack(path, folder)
    assert list(folder.iterdir()) == []
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_goes_in_comes_out(tmp_path: Path) -> None:
    """Every file of every run is the same, bit for bit, after packing and unpacking."""
    path = packed(tmp_path, 1, 2)
    (tmp_path / "here").mkdir()
    came = unpack(path, tmp_path / "here")
    went = list_runs(tmp_path / "there")
    assert len(came) == len(went) == 2
    for ours, theirs in zip(came, went, strict=True):
        for name in FILES:
            assert (ours.path / name).read_bytes() == (theirs.path / name).read_bytes()


def test_same_runs_make_the_same_bytes(tmp_path: Path) -> None:
    """Neither the clock nor the folder nor the owner gets into an archive."""
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    assert packed(tmp_path / "a").read_bytes() == packed(tmp_path / "b").read_bytes()


def test_packing_again_writes_nothing(tmp_path: Path) -> None:
    """Runs that an archive holds are not packed twice."""
    path = packed(tmp_path)
    before = path.stat().st_mtime_ns
    assert pack(list_runs(tmp_path / "there"), tmp_path, "question-quick") == []
    assert path.stat().st_mtime_ns == before


def test_last_archive_is_filled_up(tmp_path: Path) -> None:
    """A later run joins the last archive while it has room."""
    path = packed(tmp_path)
    trained(tmp_path / "there", "dcc", 2)
    assert pack(list_runs(tmp_path / "there"), tmp_path, "question-quick") == [path]
    assert len(contents(path)) == 2


def test_no_archive_is_larger_than_allowed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What does not fit goes into the next archive, whole; full ones stay as they are."""
    monkeypatch.setattr(archive, "LARGEST_ARCHIVE", 3 * archive._OVERHEAD)
    records = [trained(tmp_path / "there", "dcc", seed) for seed in (1, 2, 3)]
    paths = pack(records, tmp_path, "q")
    assert [path.name for path in paths] == ["q-01.zip", "q-02.zip"]
    assert [len(contents(path)) for path in paths] == [2, 1]
    assert all(path.stat().st_size <= archive.LARGEST_ARCHIVE for path in paths)
    records.append(trained(tmp_path / "there", "dcc", 4))
    assert pack(records, tmp_path, "q") == [tmp_path / "q-02.zip"]


def test_run_too_large_alone_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is named in one line, and the others are packed."""
    monkeypatch.setattr(archive, "LARGEST_ARCHIVE", 2 * archive._OVERHEAD)
    noise = bytes(range(256)) * 2 + bytes((7 * i * i + i // 256) % 256 for i in range(60_000))
    records = [trained(tmp_path, "dcc", 1, noise), trained(tmp_path, "dcc", 2)]
    with pytest.raises(RecordError, match=r"dcc-s1-\w+: does not fit into an archive"):
        pack(records, tmp_path, "q")
    assert [place.split("-")[-2] for place in contents(tmp_path / "q-01.zip")] == ["s2"]


def test_an_archives_runs_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The next one takes the others, whatever room is left."""
    monkeypatch.setattr(archive, "MOST_RUNS", 2)
    records = [trained(tmp_path / "there", "dcc", seed) for seed in (1, 2, 3)]
    paths = pack(records, tmp_path, "q")
    assert [len(contents(path)) for path in paths] == [2, 1]
    monkeypatch.setattr(archive, "MOST_RUNS", 0)
    assert "it holds too many files" in refused(paths[0], tmp_path / "here")


@pytest.mark.parametrize("length", [0, 1, 100, -1, -30, -200])
def test_truncated_archive_is_refused(tmp_path: Path, length: int) -> None:
    """An archive that was cut anywhere is no archive."""
    path = packed(tmp_path)
    path.write_bytes(path.read_bytes()[:length])
    refused(path, tmp_path / "here")


def test_any_damaged_byte_is_noticed_or_harmless(tmp_path: Path) -> None:
    """One byte changed: a RecordError, or (in a zip's unused fields) the same content."""
    path = packed(tmp_path)
    whole, sound = path.read_bytes(), members(path)
    noticed = 0
    for place in range(0, len(whole), 7):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        folder = tmp_path / str(place)
        folder.mkdir()
        try:
            [record] = unpack(path, folder)
        except RecordError:
            noticed += 1
        else:
            for name in FILES:
                content = (record.path / name).read_bytes()
                assert content == sound[f"pursuit-n6/{record.path.name}/{name}"]
    assert noticed > len(whole) // 7 * 3 // 4


def test_wrong_digest_is_refused(tmp_path: Path) -> None:
    """A file that the zip itself finds sound has to be the one that the manifest names."""
    path = packed(tmp_path)
    files = members(path)
    name = next(name for name in files if name.endswith("policy.safetensors"))
    zipped(path, {**files, name: b"weightz"})
    assert "policy.safetensors is damaged" in refused(path, tmp_path / "here")


def test_changed_manifest_is_refused(tmp_path: Path) -> None:
    """The manifest seals itself."""
    path = packed(tmp_path)
    files = members(path)
    zipped(path, {**files, MANIFEST: files[MANIFEST].replace(b'"size": 7', b'"size": 8')})
    assert "MANIFEST.json is damaged" in refused(path, tmp_path / "here")


@pytest.mark.parametrize("place", ["../evil", "/etc/evil", "a/../../b", "a/..", "a", "a/b/c", ""])
def test_place_outside_is_refused(tmp_path: Path, place: str) -> None:
    """A run stands in `<environment>/<run>` and nowhere else, whatever a sealed manifest says."""

    def move(manifest: dict[str, Any], files: _Members) -> None:
        [(old, run)] = manifest["runs"].items()
        manifest["runs"] = {place: run}
        for name in run:
            files[f"{place}/{name}"] = files.pop(f"{old}/{name}")

    path = sealed(packed(tmp_path), move)
    assert "is no place of a run" in refused(path, tmp_path / "here")


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "pursuit-n6/evil", "evil/"])
def test_file_that_no_manifest_lists_is_refused(tmp_path: Path, name: str) -> None:
    """Nothing is carried along with the runs."""
    path = packed(tmp_path)
    zipped(path, {**members(path), name: b"evil"})
    refused(path, tmp_path / "here")


def test_second_file_of_a_name_is_refused(tmp_path: Path) -> None:
    """Programs disagree about which of two counts."""
    path = packed(tmp_path)
    name = next(name for name in members(path) if name.endswith("run.json"))
    with (
        zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as opened,
        pytest.warns(UserWarning, match="Duplicate name"),
    ):
        opened.writestr(name, b"{}")
    assert "two files of one name" in refused(path, tmp_path / "here")


def test_link_is_refused(tmp_path: Path) -> None:
    """A member that says it is a symbolic link is none of ours."""
    path = packed(tmp_path)
    files = members(path)
    name = next(name for name in files if name.endswith("run.json"))
    link = zipfile.ZipInfo(name)
    link.external_attr = 0o120777 << 16
    zipped(path, {**{n: c for n, c in files.items() if n != name}, link: b"/etc/passwd"})
    assert "is a folder, link or device" in refused(path, tmp_path / "here")


def test_bomb_is_refused_by_what_it_declares(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Too much content is refused before any of it is unpacked."""
    monkeypatch.setattr(archive, "LARGEST_CONTENT", 1_000_000)
    path = zipped(tmp_path / "bomb.zip", {f"{n}": bytes(250_000) for n in range(5)})
    monkeypatch.setattr(zipfile.ZipFile, "read", lambda *_: pytest.fail("it was unpacked"))
    assert "would unpack to more than" in refused(path, tmp_path / "here")


def test_bomb_that_lies_about_its_size_is_refused(tmp_path: Path) -> None:
    """No more is unpacked than was declared, and then the digest does not fit."""
    path = packed(tmp_path)
    files = members(path)
    name = next(name for name in files if name.endswith("policy.safetensors"))
    zipped(path, {**files, name: bytes(10_000_000)})
    large, small = (n.to_bytes(4, "little") for n in (10_000_000, 7))
    path.write_bytes(path.read_bytes().replace(large, small))
    refused(path, tmp_path / "here")


def test_unknown_schema_is_refused(tmp_path: Path) -> None:
    """What a newer program wrote is not guessed at."""

    def newer(manifest: dict[str, Any], _: _Members) -> None:
        manifest["schema"] = 2

    path = sealed(packed(tmp_path), newer)
    assert "schema 2 is unknown" in refused(path, tmp_path / "here")


@pytest.mark.parametrize("content", [b"", b"text", b"PK\x03\x04", bytes(1000)])
def test_foreign_file_is_refused(tmp_path: Path, content: bytes) -> None:
    """What is no zip is said to be no archive of msgdrop."""
    path = tmp_path / "foreign.zip"
    path.write_bytes(content)
    assert "is no archive of msgdrop" in refused(path, tmp_path / "here")


def test_foreign_zip_is_refused(tmp_path: Path) -> None:
    """A zip without a manifest is none of ours."""
    path = zipped(tmp_path / "foreign.zip", {"holiday.txt": b"sun"})
    assert "has no MANIFEST.json" in refused(path, tmp_path / "here")


def test_password_is_refused(tmp_path: Path) -> None:
    """A member that says it is encrypted is refused in one line, not with a question."""
    path = packed(tmp_path)
    content = bytearray(path.read_bytes())
    with zipfile.ZipFile(io.BytesIO(bytes(content))) as opened:
        start = opened.start_dir
    content[start + 8] |= 1
    path.write_bytes(bytes(content))
    assert "packed in a way" in refused(path, tmp_path / "here")


def test_half_installed_run_is_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whenever installing ends, there is the whole run or none."""
    record = trained(tmp_path / "there", "dcc", 1)
    written: list[str] = []

    def failing(path: Path, content: bytes) -> None:
        assert not list(tmp_path.glob("here/**/run.json"))
        if len(written) == 3:
            raise RecordError("the disk is full", 74)
        written.append(path.name)

    monkeypatch.setattr(archive, "write_bytes_atomic", failing)
    with pytest.raises(RecordError, match="the disk is full"):
        install(record, tmp_path / "here" / record.path.name)
    assert list((tmp_path / "here").iterdir()) == []
    assert "run.json" not in written
