"""Where figures and published records are written: beside what is published, through no link."""

from collections.abc import Callable
from pathlib import Path, PurePath

import pytest

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.references import game_key, keep_references
from msgdrop_cli.report.study import publish
from msgdrop_cli.report.write import Folder, exports_folder, figures_folder, home_of, write_atomic
from tests.cli_runs import msgdrop
from tests.fake_runs import write_run

REFERENCES = {
    "episodes": 1,
    "seed": 1,
    "commit": None,
    "policies": {"random": {"meaning": "any action", "metrics": {"catches_per_500": 0.5}}},
}


def published(root: Path) -> Path:
    """A folder as `publish` leaves it: a run, its figures and the page of tables."""
    folder = root / "published" / "broken-links-quick"
    publish([write_run(root / "ours", "dcc", 1)], Folder(folder))
    write_atomic(Folder(folder), "TABLES.md", b"# tables")
    write_atomic(Folder(folder).at("figures"), "pursuit-n6-quick-1000-learning.png", b"published")
    return folder


def test_figures_go_to_the_results_folder(tmp_path: Path) -> None:
    """Also where the records are a copy of what somebody else has published."""
    copy = published(tmp_path).rename(tmp_path / "r")
    assert figures_folder(copy) == (copy, PurePath("figures"))
    assert figures_folder(tmp_path, "a-question") == (tmp_path, PurePath("figures/a-question"))


def test_figures_of_what_is_published_go_beside_it(tmp_path: Path) -> None:
    """Of all of it, of one question and of one run; the folder that is given may be a link."""
    folder = published(tmp_path)
    run = next(folder.rglob("run.json")).parent
    (tmp_path / "link").symlink_to(folder)
    for place, inside in {
        folder.parent: "figures/published",
        folder: "figures/published/broken-links-quick",
        tmp_path / "link": "figures/published/broken-links-quick",
        run: f"figures/published/broken-links-quick/pursuit-n6/{run.name}",
    }.items():
        assert figures_folder(place) == (tmp_path, PurePath(inside))
        exports = PurePath(inside.replace("figures", "exports"))
        assert exports_folder(place, "csv") == (tmp_path, exports / "csv")


def test_a_folder_that_happens_to_be_called_published_is_none(tmp_path: Path) -> None:
    """Somebody may keep a whole project in one."""
    results = tmp_path / "published" / "project" / "results"
    write_run(results, "dcc", 1)
    assert figures_folder(results) == (results, PurePath("figures"))


def test_relative_paths_stay_relative(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is printed is as short as what was typed."""
    monkeypatch.chdir(published(tmp_path))
    assert figures_folder(Path()) == (
        Path("../.."),
        PurePath("figures/published/broken-links-quick"),
    )


def test_a_results_folder_is_found_from_inside(tmp_path: Path) -> None:
    """From all own runs, from a game's and from one; and from what is published."""
    run = write_run(tmp_path, "dcc", 1).path
    study = published(tmp_path)
    for place in (tmp_path, run, run.parent, run.parent.parent, study, study.parent):
        assert home_of(place) == tmp_path


def test_a_results_folder_may_lie_in_a_folder_called_runs(tmp_path: Path) -> None:
    """As `--results runs/first` says; what that lies in is not ours to write to."""
    results = tmp_path / "runs" / "first"
    write_run(results, "dcc", 1)
    assert home_of(results) == results


def test_plotting_what_is_published_changes_nothing_of_it(tmp_path: Path) -> None:
    """No file in it is written or added, and the figures are there all the same."""
    folder = published(tmp_path)
    keep_references(folder, game_key({"name": "pursuit-n6"}), REFERENCES)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    said = msgdrop("plot", folder)
    assert said.code == 0, said.err
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    assert [Path(line).parent for line in said.out.splitlines()] == [
        tmp_path / "figures" / "published" / "broken-links-quick"
    ]


def link_the_folder(inside: Path, target: Path) -> None:
    """The whole folder is a link."""
    inside.parent.mkdir(parents=True, exist_ok=True)
    inside.symlink_to(target)


def link_above(inside: Path, target: Path) -> None:
    """The folder lies in one that is a link."""
    inside.parent.parent.mkdir(parents=True, exist_ok=True)
    inside.parent.symlink_to(target)


def link_to_nothing(inside: Path, target: Path) -> None:
    """The link's target is yet to be made."""
    link_the_folder(inside, target / "new")


@pytest.mark.parametrize("link", [link_the_folder, link_above, link_to_nothing])
def test_no_link_is_followed_to_write(link: Callable[[Path, Path], None], tmp_path: Path) -> None:
    """A link in a results folder from somebody else is one line and 73; its target stays empty."""
    target = tmp_path / "elsewhere"
    target.mkdir()
    folder = Folder(tmp_path / "results", PurePath("figures", "a-question"))
    link(folder.root / folder.inside, target)
    with pytest.raises(RecordError, match="is a symbolic link") as caught:
        write_atomic(folder, "f.png", b"figure")
    assert caught.value.exit_code == 73
    assert list(target.iterdir()) == []


def test_a_linked_file_is_replaced_not_followed(tmp_path: Path) -> None:
    """What it pointed to keeps its content."""
    mine = tmp_path / "mine"
    mine.write_text("mine")
    (tmp_path / "f.png").symlink_to(mine)
    path = write_atomic(Folder(tmp_path), "f.png", b"figure")
    assert (path.is_symlink(), path.read_bytes(), mine.read_text()) == (False, b"figure", "mine")


def test_the_folder_that_people_name_may_be_a_link(tmp_path: Path) -> None:
    """Their own link to a large disk is their business."""
    (tmp_path / "disk").mkdir()
    (tmp_path / "results").symlink_to("disk")
    write_atomic(Folder(tmp_path / "results").at("figures"), "f.png", b"figure")
    assert (tmp_path / "disk" / "figures" / "f.png").read_bytes() == b"figure"


def test_nothing_is_published_through_a_link(tmp_path: Path) -> None:
    """A folder in what is published that leads elsewhere gets no run."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "published").mkdir()
    (tmp_path / "published" / "pursuit-n6").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RecordError, match="is a symbolic link"):
        publish([write_run(tmp_path / "ours", "dcc", 1)], Folder(tmp_path / "published"))
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_references_are_not_kept_through_a_link(tmp_path: Path) -> None:
    """They are no reason to write elsewhere either."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "references").symlink_to("elsewhere")
    with pytest.raises(RecordError, match="is a symbolic link"):
        keep_references(tmp_path, "some-game", REFERENCES)
    assert list((tmp_path / "elsewhere").iterdir()) == []
