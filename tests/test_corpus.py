"""What once broke something, or was tried for it, is tried again: `tests/corpus` only grows."""

from pathlib import Path

import pytest

from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError
from tests.faults.corpus import CORPUS, NAMES
from tests.faults.study import QUESTION
from tests.fuzz import __main__ as fuzz
from tests.fuzz.readers import READERS, Reader, try_reading

FOUND = sorted((CORPUS / "readers").glob("*/*"))
DEFINITIONS = sorted((CORPUS / "definitions").glob("*.toml"))


def test_there_is_a_corpus() -> None:
    """The tests below are not empty by a wrong path."""
    assert len(NAMES) > 50
    assert len(DEFINITIONS) > 10


@pytest.mark.parametrize("file", DEFINITIONS, ids=lambda file: file.stem)
def test_a_hostile_definition_is_refused_in_one_line(file: Path) -> None:
    """No other error than ours, and nothing that a terminal would obey."""
    with pytest.raises(DefinitionError) as caught:
        plan(load_definition(str(file)), "quick", catalogue())
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 1_000


@pytest.mark.parametrize("key", ["variants", "environments", "profiles"])
def test_no_hostile_name_becomes_a_folder(tmp_path: Path, key: str) -> None:
    """Variants, games and profiles are names of folders: none leads out of one."""
    file = tmp_path / "q.toml"
    known = catalogue()
    for name in NAMES:
        quoted = '"' + "".join(f"\\u{ord(c):04x}" if ord(c) < 0x10000 else c for c in name) + '"'
        text = {
            "variants": QUESTION.replace('"md-0.2"', quoted),
            "environments": QUESTION.replace('"pursuit-n6"', quoted),
            "profiles": QUESTION.replace("profiles.quick", f"profiles.{quoted}"),
        }[key]
        file.write_text(text, errors="replace")
        try:
            runs = plan(load_definition(str(file)), "quick", known).runs
        except DefinitionError:
            continue
        for run in runs:
            for part in (run.variant, run.spec.environment, run.profile):
                assert Path(part).name == part, name
                assert part not in (".", ".."), name


def test_every_finding_has_a_reader() -> None:
    """None is passed over by a wrong name, and there are some."""
    assert {file.parent.name for file in FOUND} <= set(READERS)
    assert len(FOUND) > 5


@pytest.mark.parametrize("file", FOUND, ids=lambda file: f"{file.parent.name}-{file.stem}")
def test_a_reader_takes_or_refuses_it(file: Path) -> None:
    """In one line, if it refuses."""
    try_reading(file.parent.name, file.read_bytes())


@pytest.mark.parametrize("name", READERS)
def test_the_fuzzer_begins_with_what_a_reader_takes(name: str, tmp_path: Path) -> None:
    """Else it would try the first refusal for ever."""
    for number, sound in enumerate(READERS[name].seeds()):
        (folder := tmp_path / str(number)).mkdir()
        READERS[name].read(sound, folder)


def test_the_fuzzer_finds_and_keeps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a reader breaks on is a file of the corpus afterwards."""

    def break_on_nul(content: bytes, _: Path) -> None:
        assert b"\0" not in content

    monkeypatch.setitem(READERS, "weak", Reader(break_on_nul, lambda: [b"sound"]))
    monkeypatch.setattr(fuzz, "FOUND", tmp_path)
    with pytest.raises(AssertionError):
        fuzz._change_bytes("weak", 20)
    [kept] = (tmp_path / "weak").iterdir()
    assert b"\0" in kept.read_bytes()
