"""`msgdrop diff`: two runs or two variants side by side."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from msgdrop_cli.commands.parts import completion, console, options
from msgdrop_cli.commands.parts.listing import runs_in
from msgdrop_cli.errors import DefinitionError, nearest
from msgdrop_cli.records.store import RunRecord

if TYPE_CHECKING:
    from msgdrop_cli.analysis.comparison import Comparison, Difference, Differing
    from msgdrop_cli.analysis.summary import Group

app = typer.Typer()
_COMMIT = re.compile(r"^([0-9a-f]{12})[0-9a-f]+")
_Side = Annotated[
    str,
    typer.Argument(
        help="A variant, a run id, or a folder of runs.", autocompletion=completion.sides
    ),
]


@app.command(
    epilog=options.examples(
        "diff fdc md-0.2 --results results/published/navigation-half-million",
        "diff 937be297 f8e60a3e",
    )
)
def diff(
    one: _Side,
    other: _Side,
    results: options.Results = Path("results"),
    json: options.Json = False,
) -> int:
    """Compare two runs or two variants: settings, versions, curves, evaluations.

    Every difference is the second one minus the first, paired by seed.
    """
    from msgdrop_cli.analysis.comparison import compare

    first, second = _side(one, results), _side(other, results)
    pairs = [(group, first[group], second[group]) for group in first if group in second]
    if not pairs and len(first) == len(second) == 1:  # of other lengths or games: settings differ
        [(group, mine)], [theirs] = first.items(), second.values()
        pairs = [(group, mine, theirs)]
    if not pairs:
        raise DefinitionError(f"{one} and {other}: were never trained in one game at one scale")
    found = [(group, compare(mine, theirs)) for group, mine, theirs in pairs]
    if json:
        console.result_json([_json(group, each) for group, each in found])
        return 0
    for group, each in found:
        _show(f"{one} and {other}, {group.environment}, {group.profile} profile", each)
    return 0


def _side(text: str, root: Path) -> dict["Group", list[RunRecord]]:
    """The runs that are meant, by what must be alike in them."""
    if not text:  # a Path takes it for the folder we are in
        raise DefinitionError("diff: expected a variant, a run id or a folder, not ''")
    from msgdrop_cli.analysis.summary import Group, once_each

    if Path(text).is_dir():
        found = once_each(runs_in(Path(text)))
    else:
        records = once_each(runs_in(root))
        found = [run for run in records if text in (run.run_id, run.variant)]
        if not found:
            known = {run.variant for run in records}
            raise DefinitionError(
                f"{root}: no run or variant is {text[:40]!r}; {nearest(text, known)}"
            )
    if len(setups := {run.overrides for run in found if run.variant == text}) > 1:
        words = " or ".join(", ".join(each) or "nothing overridden" for each in sorted(setups))
        raise DefinitionError(f"{text}: which one, {words}? name a run id or a folder")
    groups: dict[Group, list[RunRecord]] = {}
    for run in found:
        steps = run.setup.train_env_steps if run.setup else 0
        groups.setdefault(Group(run.environment, steps, run.profile), []).append(run)
    return groups


def _show(title: str, found: "Comparison") -> None:
    from msgdrop_cli.report.table import Table

    for name, differing in (("setting", found.settings), ("made with", found.made_with)):
        if differing:
            headers = (name, "first", "second")
            rows = tuple(
                (each.name, _shortly(each.name, each.one), _shortly(each.name, each.other))
                for each in differing
            )
            console.table(
                Table(title=title, headers=headers, rows=rows, caption=""),
                numbers_from=len(headers),
            )
        else:
            console.result(f"\n{title}\n{name}: nothing differs")
        title = "besides"
    rows_of = [
        (each.channel.short, each.metric.replace("_", " "), _in_words(each))
        for each in found.evaluations
    ]
    console.table(
        Table(
            title="after training, second minus first",
            headers=("through", "metric", "difference [95%]"),
            rows=tuple(rows_of),
            caption=_pairs(found),
        ),
        numbers_from=2,
    )
    console.result(_of_curves(found))


def _shortly(name: str, values: Sequence[Any]) -> str:
    """What a side says of a fact; of a commit the first digits, and its `+` for changed files."""
    from msgdrop_cli.analysis.comparison import in_words

    if name == "commit":
        values = [_COMMIT.sub(r"\1", str(each)) for each in values]
    return in_words(values)


def _of_curves(found: "Comparison") -> str:
    if (most := found.largest) is None:
        return "curves: no seed in common"
    metric = found.metric.replace("_", " ")
    return f"curves: differ most at {most[0]:,} env steps, by {most[1]:+.4g} {metric}"


def _pairs(found: "Comparison") -> str:
    counts = sorted({each.pairs for each in found.evaluations})
    pairs = " or ".join(map(str, counts)) or "no"
    if counts == [1]:
        return f"1 pair, {found.episodes:,} episodes a run; one pair has no interval."
    return (
        f"{pairs} pairs, {found.episodes:,} episodes a run; below six pairs the lowest"
        " and the highest; the interval is of each row alone."
    )


def _in_words(each: "Difference") -> str:
    from msgdrop_cli.report.table import NOTHING

    ends = f"{each.interval.low:.3g}, {each.interval.high:.3g}" if each.interval else NOTHING
    return f"{each.mean:+.3g} [{ends}]"


def _json(group: "Group", found: "Comparison") -> dict[str, Any]:
    return {
        **group._asdict(),
        "settings": _facts(found.settings),
        "made_with": _facts(found.made_with),
        "episodes": found.episodes,
        "evaluations": [
            {
                "channel": each.channel.key,
                "metric": each.metric,
                "difference": each.mean,
                "low": each.interval.low if each.interval else None,
                "high": each.interval.high if each.interval else None,
                "pairs": each.pairs,
            }
            for each in found.evaluations
        ],
        "curves_differ_most": found.largest,
    }


def _facts(rows: Sequence["Differing"]) -> dict[str, list[Any]]:
    """What each side says, as its records do; a list of all where its runs are not agreed."""
    return {row.name: [_agreed(row.one), _agreed(row.other)] for row in rows}


def _agreed(values: Sequence[Any]) -> Any:
    return list(values) if len(values) > 1 else next(iter(values), None)
