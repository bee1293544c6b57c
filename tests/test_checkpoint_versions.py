"""Checkpoints that another version of msgdrop wrote: they go on, or are named and kept."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import msgdrop_cli
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.tensors import read_tensors, write_tensors
from msgdrop_cli.errors import RunError
from msgdrop_cli.records.seals import fingerprint
from tests.runs import StopAt, digest, planned
from tests.stopped_runs import newest, resume, rewrite, segments, stop


@pytest.fixture
def stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a run that was stopped after two checkpoints."""
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
    return stop(tmp_path)


def test_checkpoints_of_the_first_version_go_on(stopped: Path, tmp_path: Path) -> None:
    """They named no version, and shared files: [15, 40) served both here, [40, 45) the newest."""
    older, newer = sorted((stopped / "checkpoints").glob("0*"))
    [shared], [whole] = segments(older), segments(newer)
    last = {name: tensor[20:].clone() for name, tensor in read_tensors(whole).items()}
    write_tensors(whole.with_name("last"), last)
    whole.unlink()
    names = {
        shared.rename(shared.with_name(f"{15:015d}-{40:015d}.safetensors")): (older, newer),
        whole.with_name("last").rename(shared.with_name(f"{40:015d}-{45:015d}.safetensors")): (
            newer,
        ),
    }
    for checkpoint in (older, newer):

        def as_it_was(manifest: dict[str, Any], checkpoint: Path = checkpoint) -> None:
            del manifest["schema"], manifest["version"]
            manifest["files"] = {"state.safetensors": manifest["files"]["state.safetensors"]} | {
                file.name: fingerprint(file.read_bytes())
                for file, owners in names.items()
                if checkpoint in owners
            }

        rewrite(checkpoint, as_it_was)
    assert resume(stopped, StopAt(10)).env_steps == 440
    assert not {path.name for path in segments(newer)} & {
        path.name for path in segments(newest(stopped))
    }
    assert resume(stopped).reason is None
    [undisturbed] = train_cohort([planned()], tmp_path / "undisturbed")
    assert digest(stopped) == digest(undisturbed.path)


def test_the_manifest_says_which_version_wrote_it(stopped: Path) -> None:
    """The version of the code, and a number for the form of the checkpoint."""
    manifest = json.loads((newest(stopped) / "MANIFEST.json").read_text())
    assert (manifest["version"], manifest["schema"]) == (msgdrop_cli.__version__, 1)


def drop(counter: str) -> Callable[[dict[str, Any]], object]:
    """Leaves a counter out of a manifest."""
    return lambda manifest: manifest["counters"].pop(counter)


OTHERS: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "no kernel": (drop("kernel"), "'kernel' is missing"),
    "no rows": (drop("rows"), "'rows' is missing"),
    "no streams": (drop("streams"), "'streams' is missing"),
    "no files": (lambda manifest: manifest.pop("files"), "'files' is missing"),
    "another schema": (lambda manifest: manifest.update(schema=2), "schema 2 is unknown"),
    "a new counter": (lambda manifest: manifest["counters"].update(new=1), "unknown key"),
    "no state": (
        lambda manifest: manifest["files"].pop("state.safetensors"),
        "the files are not those of a checkpoint",
    ),
    "a gap": (lambda manifest: manifest["counters"].update(added=46), "stretch .* is missing"),
}


@pytest.mark.parametrize(("change", "said"), OTHERS.values(), ids=OTHERS)
def test_another_versions_checkpoint_is_named_and_kept(
    change: Callable[[dict[str, Any]], object], said: str, stopped: Path
) -> None:
    """It is whole, and worth hours: nothing is deleted, and two ways out are said."""
    rewrite(newest(stopped), lambda manifest: [change(manifest), manifest.update(version="7.1")])
    before = {path: path.stat().st_mtime_ns for path in (stopped / "checkpoints").rglob("*")}
    for _ in range(2):
        with pytest.raises(RunError, match=rf"{said}.*; another msgdrop \(7.1\) .* or remove"):
            resume(stopped)
    after = {path: path.stat().st_mtime_ns for path in (stopped / "checkpoints").rglob("*")}
    assert after == before


def test_another_versions_tensors_are_named(stopped: Path) -> None:
    """A network that the run has not, in a checkpoint that is whole."""
    file = newest(stopped) / "state.safetensors"
    tensors = read_tensors(file)
    known = write_tensors(file, {**tensors, "learner.new": tensors["obs"].clone()})
    rewrite(newest(stopped), lambda manifest: manifest["files"].update({file.name: known}))
    outcome = resume(stopped)
    assert outcome.status == "failed"
    assert "tensor 'learner.new' is on one side only; another msgdrop" in str(outcome.reason)
