"""The command line as people use it: what it shows, writes and exits with."""

import json
import re
import shutil
from pathlib import Path

import pytest

from msgdrop_cli import __version__, scheduler
from msgdrop_cli.__main__ import greeting
from msgdrop_cli.commands.parts import words
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.stopping import Control
from tests.cli_runs import Store, copied_store, filled_store, msgdrop, python

TINY = (
    *("training.games=4", "training.log_every_env_steps=50", "environment.time_limit=40"),
    *("algorithm.replay_capacity=400", "algorithm.replay_start_env_steps=100"),
)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs, trained once; tests that change them take `copy`."""
    return filled_store(tmp_path_factory.mktemp("cli"))


@pytest.fixture
def copy(store: Store, tmp_path: Path) -> Store:
    """The same, to be changed."""
    return copied_store(store, tmp_path)


def test_ablate_ends_in_a_table_a_verdict_and_a_figure(store: Store) -> None:
    """One command trains, evaluates, compares, judges and draws."""
    assert store.said.code == 0, store.said.err
    assert "DCC-MD 0.2" in store.said.out
    assert re.search(r"estimate +Message-dropout is better", store.said.out)
    figures = [line.split()[-1] for line in store.said.out.splitlines() if "figure  " in line]
    assert figures
    assert all(Path(figure).is_file() for figure in figures)


def test_plan_comes_before_training(store: Store) -> None:
    """Title, question, runs and env steps are said on stderr before the first run begins."""
    # A run may be done before anybody has looked whether it has begun.
    plan, *later = re.split(r"^(?:training|done) +pursuit-n6", store.said.err, flags=re.MULTILINE)
    assert later
    assert "A tiny question" in plan
    assert "4 runs: 4 new" in plan
    assert "800 env steps" in plan


def test_labels_are_no_markup(store: Store) -> None:
    """A label with brackets is shown as it is, in tables and in progress."""
    assert "DCC [/red]" in store.said.out
    assert "DCC [/red], seed 1" in store.said.err


def test_second_ablate_trains_nothing(store: Store) -> None:
    """Asking again shows the same results and says that nothing was trained."""
    again = store.ablate()
    assert again.code == 0
    assert "nothing to train" in again.err
    assert again.out == store.said.out


def test_one_more_seed_trains_only_what_is_new(copy: Store) -> None:
    """A third seed plans two new runs beside the four finished ones."""
    said = copy.ablate("--seeds", "3", "--dry-run")
    assert "6 runs: 4 finished, 2 new" in said.out


def test_json_is_one_document(store: Store) -> None:
    """`--json` puts results, claims and figures on stdout, and nothing else."""
    said = store.ablate("--json")
    document = json.loads(said.out)
    assert {row["variant"] for row in document["results"]} == {"dcc", "md-0.2"}
    assert [run["status"] for run in document["runs"]] == ["done"] * 4
    assert document["claims"][0]["verdict"] == "estimate"


def test_dry_run_writes_nothing(store: Store, tmp_path: Path) -> None:
    """`--dry-run` shows the plan with time and disk on stdout and leaves no folder."""
    said = msgdrop("ablate", store.question, "--results", tmp_path / "new", "--dry-run")
    assert said.code == 0
    assert re.search(r"about \d+ s \(\d+ s to \d+ s\) with 2 workers", said.out)
    assert "disk" in said.out
    assert not (tmp_path / "new").exists()


def test_time_is_measured_where_it_can_be(
    store: Store, copy: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Finished runs of the same work on the same device give the speed; else a rule of thumb."""
    assert "rule of thumb" in store.said.err
    for path, cpu_time_s in zip(
        sorted(copy.results.rglob("run.json")), (4, 2, 4, 0.1), strict=True
    ):
        times = {"wall_time_s": 2 * cpu_time_s, "cpu_time_s": cpu_time_s}
        path.write_text(json.dumps(json.loads(path.read_text()) | times))

    def planned(*arguments: str) -> tuple[int, list[int], str]:
        said = copy.ablate("--seeds", "3", "--dry-run", "--json", *arguments)
        document = json.loads(said.out)
        return document["seconds"], document["seconds_range"], document["seconds_source"]

    # Two new runs of 200 env steps at 200 / 4 a second; 0.1 s is too short to say anything.
    # The fastest took 2 s, and a quarter more than the likely is always possible.
    measured = "processor time of your finished runs like these; if"
    assert planned() == (8, [4, 10], f"{measured} 1 core is free")
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    assert planned("--workers", "2") == (4, [2, 5], f"{measured} 2 cores are free")
    assert planned("--set", "algorithm.batch_size=64")[2].startswith("rule of thumb")


@pytest.mark.parametrize("profile", ["quick", "million", "paper"])
def test_train_takes_a_learner_without_epsilon(profile: str, tmp_path: Path) -> None:
    """MADDPG anneals nothing, at any length."""
    arguments = ("--env", "waterworld-n8", "--algorithm", "maddpg-md", "--profile", profile)
    said = msgdrop("train", *arguments, "--dry-run", "--results", tmp_path)
    assert said.code == 0, said.err


def test_train_is_a_question_of_one_variant(tmp_path: Path) -> None:
    """`train` makes one run of the named algorithm, and the overrides stand in its record."""
    sets = (*TINY, "training.train_env_steps=200", "algorithm.rate=0.4")
    arguments = [part for each in sets for part in ("--set", each)]
    said = msgdrop("train", "--results", tmp_path, "--workers", "1", *arguments)
    assert said.code == 0, said.err
    [path] = tmp_path.rglob("run.json")
    run = json.loads(path.read_text())
    assert (run["variant"], run["seed"], run["env_steps"]) == ("dcc-md", 1, 200)
    assert run["spec"]["algorithm"]["rate"] == 0.4


def test_failed_run_does_not_stop_the_others(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With one run failing the other three end, the table says so, and the exit code is 3."""
    train = scheduler._train

    def fail_once(task: scheduler.Task, control: Control) -> list[Outcome]:
        if (task.train[0].variant, task.train[0].spec.seed) == ("dcc", 1):
            raise ValueError("the disk is on fire")
        return train(task, control)

    monkeypatch.setattr(scheduler, "_train", fail_once)
    said = store._replace(results=tmp_path / "results").ablate()
    assert said.code == 3
    assert "the disk is on fire" in said.err
    assert said.err.count("done         ") == 3


def test_eval_stands_broken_links_beside_whole_ones(copy: Store) -> None:
    """`eval --broken-links half` plays what is missing and shows none and half."""
    few = ("--episodes", "8", "--workers", "1")
    said = msgdrop("eval", copy.results, "--broken-links", "half", *few)
    assert said.code == 0, said.err
    assert "none broken" in said.out
    assert "half broken" in said.out
    again = msgdrop("eval", copy.results, "--broken-links", "half", *few)
    assert "evaluated" not in again.err
    assert again.out == said.out


def test_published_runs_are_not_written_to(copy: Store) -> None:
    """What published runs lack is played elsewhere."""
    published = copy.results / "published"
    (copy.results / "runs").rename(published)
    before = {path: path.read_bytes() for path in published.rglob("*") if path.is_file()}
    said = msgdrop(
        "eval", copy.results, "--broken-links", "all", "--episodes", "8", "--workers", "1"
    )
    assert said.code == 0, said.err
    assert "all broken" in said.out
    assert {path: path.read_bytes() for path in published.rglob("*") if path.is_file()} == before


def test_published_runs_count_only_without_others(copy: Store) -> None:
    """Own runs are evaluated; the published ones stand in where there are none."""
    shutil.copytree(copy.results / "runs", copy.results / "published")
    for own in sorted((copy.results / "runs").rglob("md-0.2-*")):
        shutil.rmtree(own)
    said = msgdrop("eval", copy.results, "--episodes", "8")
    assert "2 trained runs" in said.err
    assert "DCC-MD" not in said.out


def test_what_is_published_is_evaluated_on_a_fresh_clone(copy: Store) -> None:
    """`publish` leaves numbers of every seed and one policy a variant; `eval` counts all seeds."""
    to = copy.results.parent / "published"
    said = msgdrop("publish", copy.question, "--results", copy.results, "--to", to)
    assert said.code == 0, said.err
    assert (to / "tiny-quick" / "TABLES.md").read_text().count("| DCC-MD 0.2 | 2 |") == 1
    assert len(list(to.rglob("run.json"))) == 4
    assert len(list(to.rglob("policy.safetensors"))) == 2
    evaluated = msgdrop("eval", to, "--episodes", "8", "--json")
    assert evaluated.code == 0, evaluated.err
    assert {row["seeds"] for row in json.loads(evaluated.out)["results"]} == {2}
    planned = msgdrop("ablate", copy.question, "--results", to, "--dry-run", "--json")
    assert json.loads(planned.out)["env_steps"] == 4 * 200  # published runs are nobody's own


def test_publish_lists_what_it_wrote_as_json(copy: Store) -> None:
    """`publish --json` is one document of paths, all of which are there."""
    to = copy.results.parent / "published"
    said = msgdrop("publish", copy.question, "--results", copy.results, "--to", to, "--json")
    paths = json.loads(said.out)
    assert {kind: len(paths[kind]) for kind in ("runs", "tables")} == {"runs": 4, "tables": 1}
    assert paths["figures"]
    assert all(Path(path).exists() for kind in paths for path in paths[kind])


def test_publish_wants_finished_runs(tmp_path: Path) -> None:
    """Nothing is published out of an empty folder, and the line says how to train."""
    to = tmp_path / "published"
    said = msgdrop("publish", "broken-links", "--results", tmp_path, "--to", to)
    assert said.code == 2
    assert "msgdrop ablate broken-links" in said.err
    assert not to.exists()


def test_unstable_test_shows_all_three_channels(copy: Store) -> None:
    """The paper's test shows none, half and all, and draws the bars."""
    said = msgdrop("unstable-test", copy.results, "--episodes", "8", "--workers", "1")
    assert said.code == 0, said.err
    assert "all broken" in said.out
    assert "figure  " in said.out


def test_plot_prints_the_figures_paths(copy: Store) -> None:
    """`plot` prints the path of every figure, and each of them is there."""
    said = msgdrop("plot", copy.results)
    assert said.code == 0, said.err
    assert all(Path(line).stat().st_size > 1_000 for line in said.out.splitlines())


def test_status_shows_how_far_runs_are(store: Store) -> None:
    """`status` shows every run with its word."""
    said = msgdrop("status", store.results)
    assert "4 runs: 4 done" in said.out
    assert said.out.count("100%") == 4


def test_status_loads_nothing_heavy(store: Store) -> None:
    """`status` is cold: no torch, numpy, matplotlib or joblib."""
    done = python("-X", "importtime", "-m", "msgdrop_cli", "status", str(store.results))
    assert done.returncode == 0
    loaded = {line.rsplit("|", 1)[-1].strip() for line in done.stderr.splitlines()}
    assert loaded & {"torch", "numpy", "matplotlib", "joblib"} == set()


def test_greeting_comes_before_the_program(store: Store) -> None:
    """The first line needs nothing of the program but its version and what Ctrl-C does."""
    code = "import msgdrop_cli.__main__, sys; print([m for m in sys.modules if 'msgdrop_cli' in m])"
    loaded = "['msgdrop_cli', 'msgdrop_cli.signals', 'msgdrop_cli.__main__']\n"
    assert python("-c", code).stdout == loaded
    code = "import msgdrop_cli.__main__, sys; print('typer' in sys.modules)"
    assert python("-c", code).stdout == "False\n"


def test_greeting_says_what_was_asked() -> None:
    """Slow commands are greeted in one printable line; help, version and lists are not."""
    assert greeting(["plot", "a\nb"]) == f"msgdrop {__version__}: plot a b"
    assert greeting(["plot", "--help"]) is greeting(["train", "-h"]) is None
    assert greeting(["ablate", "--list"]) is None
    assert greeting(["--version"]) is None
    assert greeting(["ablate"]) is None
    assert greeting(["status"]) is None


def test_version_and_help_are_results() -> None:
    """Version and help go to stdout and exit with 0; so does the list of questions."""
    assert msgdrop("--version") == (0, f"msgdrop {__version__}\n", "")
    assert msgdrop("--help").out.startswith("Usage: msgdrop")
    assert "blockwise-vs-elementwise" in msgdrop("ablate").out


def test_fractions_of_broken_links() -> None:
    """Words and fractions; nothing else."""
    texts = ("none", "half", "all", "0.3")
    shares = (0.0, 0.5, 1.0, 0.3)
    assert [words.channel(text, "--channel") for text in texts] == [*map(Channel.read, shares)]
    with pytest.raises(DefinitionError, match="--channel: expected none, half, all, a share"):
        words.channel("1.5", "--channel")


def test_numbers_for_people() -> None:
    """Durations and sizes as people write them."""
    durations = [words.duration(seconds) for seconds in (0.4, 75, 3_700, 400_000)]
    assert durations == ["0 s", "1:15 min", "1:01 h", "4.6 days"]
    assert [words.size(count) for count in (999, 1_200_000, 23e9)] == ["999 B", "1.2 MB", "23 GB"]
