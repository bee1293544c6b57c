"""What the command line says of numbers that are compared: overrides, episodes, whose claims."""

import json
import re
import shlex
from pathlib import Path

import pytest

from msgdrop_cli.records.files import jsonl_bytes, write_bytes_atomic
from tests.cli_runs import Store, copied_store, filled_store, msgdrop

SETTING = "algorithm.gamma=0.5"
OF_ONE = "variants.md-0.2.algorithm.rate=0.4"


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs as the question says, and four overridden ones."""
    store = filled_store(tmp_path_factory.mktemp("cli"))
    return store._replace(said=store.ablate("--set", SETTING, "--set", OF_ONE))


def test_overrides_stand_over_the_plan(store: Store) -> None:
    """As they were typed, before anything is trained."""
    assert store.said.code == 0, store.said.err
    assert f"overridden  {SETTING}, {OF_ONE}\n" in store.said.err
    dry = store.ablate("--set", SETTING, "--dry-run")
    assert f"overridden  {SETTING}\n" in dry.out
    assert "overridden" not in store.ablate("--dry-run").out


def test_nobody_takes_an_overridden_table_for_another(store: Store) -> None:
    """Title, caption, label and verdict say it; the table without overrides says nothing."""
    said = " ".join(store.said.out.split())
    assert "after 200 env steps (quick, overridden)" in said
    assert f"200 env steps a run, overridden: {SETTING}; 8 greedy" in said
    assert "DCC [/red] 2 " in said
    assert "DCC-MD 0.2 (rate=0.4) 2 " in said
    assert "md-0.2 was overridden: algorithm.rate=0.4" in said
    plain = store.ablate()
    assert plain.code == 0, plain.err
    assert "nothing to train" in plain.err
    for word in ("overridden", "gamma", "rate=0.4"):
        assert word not in plain.out


def test_records_keep_what_was_overridden(store: Store) -> None:
    """So `plot` and `eval` show it as well, of these runs and of no others."""
    said = msgdrop("eval", store.results, "--episodes", "8", "--json")
    assert {row["label"] for row in json.loads(said.out)["results"]} == {
        "DCC [/red] (gamma=0.5)",
        "DCC [/red] (gamma=0.99)",
        "DCC-MD 0.2 (gamma=0.5, rate=0.4)",
        "DCC-MD 0.2 (gamma=0.99, rate=0.2)",
    }


def test_what_a_refusal_proposes_works(store: Store) -> None:
    """An override of what the variants set is refused; the line's own words are taken."""
    refused = store.ablate("--set", "algorithm.rate=0.4", "--dry-run")
    assert (refused.code, refused.out) == (2, "")
    assert refused.err.count("\n") == 1
    proposed = shlex.split(refused.err.partition("to change one alone: ")[2])
    taken = store.ablate(*proposed, "--set", SETTING, "--dry-run")
    assert taken.code == 0, taken.err
    assert "4 runs: 4 finished" in taken.out


def test_help_does_not_propose_what_is_refused() -> None:
    """The first example of `--set` is a setting that no variant has of its own."""
    example = re.search(r"all variants, e\.g\.\s+(\S+=\d\.\d)", msgdrop("ablate", "--help").out)
    assert example
    said = msgdrop("ablate", "dropout-rate", "--set", example[1], "--dry-run")
    assert said.code == 0, said.err


def test_eval_compares_equally_many_episodes(store: Store, tmp_path: Path) -> None:
    """Of eight whole ones the first three stand beside three with broken links."""
    results = copied_store(store, tmp_path).results
    few = ("--broken-links", "0.3", "--episodes", "3", "--workers", "1")
    said = msgdrop("eval", results, *few)
    assert said.code == 0, said.err
    assert "the first 3 evaluation episodes per seed" in " ".join(said.out.split())
    rows = json.loads(msgdrop("eval", results, *few, "--json").out)["results"]
    assert {(row["broken_links"], row["episodes"]) for row in rows} == {(0.0, 3), (0.3, 3)}


def test_figures_leave_out_short_evaluations_with_a_note(store: Store, tmp_path: Path) -> None:
    """Three episodes with broken links, of an older program, are drawn beside no eight."""
    copy = copied_store(store, tmp_path)
    for log in copy.results.rglob("episodes.jsonl"):
        rows = [json.loads(line) for line in log.read_text().splitlines()]
        few = [{**row, "broken_links": 0.3} for row in rows if row["broken_links"] == 0.0][:3]
        write_bytes_atomic(log, jsonl_bytes([*rows, *few]))
    drawn = msgdrop("plot", copy.results)
    assert "left out, with fewer episodes: " in drawn.err
    assert "broken-links" not in drawn.out


def test_claims_are_the_papers_only_where_they_are(store: Store) -> None:
    """Over the claims of somebody's own file stands no more than `Claims`."""
    assert "\nClaims\n" in store.said.out
    assert "of the paper" not in store.said.out
    shipped = msgdrop("unstable-test", store.results, "--episodes", "3", "--workers", "1")
    assert "\nClaims of the paper\n" in shipped.out
