"""Summaries and verdicts as tables of text, for the terminal and for Markdown; prints nothing.

Every caption carries environment, profile, training length and seeds, so that no number is taken
for one of another scale.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from msgdrop_cli.analysis.intervals import FEWEST
from msgdrop_cli.analysis.metrics import NamedMetric
from msgdrop_cli.analysis.statistics import FEWEST_RESAMPLED, Interval
from msgdrop_cli.analysis.summary import Arm, Group, Row, Summary
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.definition.channel import MANY, NONE_BROKEN, Channel, title_of
from msgdrop_cli.records.references import References

NOTHING = "\u2013"
_MARKS = re.compile(r"[\\`*|]|(?<=\])[(\[]|(?<!\w)_|_(?!\w)")
"""What Markdown would take for a cell's end, code, emphasis, a link or a picture."""
_ERRORS = (
    " Error in a seed: the standard error over its episodes (root mean square of the seeds), which"
    " more episodes make smaller; spread: standard deviation of the seeds, that error included."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Plain text cells; every row is as long as the headers."""

    title: str
    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str


def results_table(summary: Summary, group: Group, channel: Channel = NONE_BROKEN) -> Table:
    """The arms of one group after training: seeds, headline with interval, IQM, other metrics."""
    metrics = summary.metrics(group.environment)
    others = metrics.all[1:]
    arms = summary.arms_of(group)
    rows = [
        (
            arm.label,
            seeds_text(arm, [row := arm.row(metrics.headline.name, channel)]),
            _estimate(row),
            _errors(row),
            _with_interval(row.iqm, row.iqm_interval) if row else NOTHING,
            *(_mean(arm.row(each.name, channel)) for each in others),
        )
        for arm in arms
    ]
    references = summary.references_of(group)
    columns = (metrics.headline.name, None, None, *(each.name for each in others))
    rows += reference_rows(references, [(name, channel) for name in columns])
    shown = [row for arm in arms for row in arm.rows if row.channel == channel]
    evaluation = (
        f"{_first(shown)}{shown[0].episodes:,} {'' if channel.epsilon else 'greedy '}evaluation "
        f"episodes per seed, {channel.label}"
        if shown
        else "not evaluated yet"
    )
    return Table(
        title=f"{group.environment} after {group.train_env_steps:,} env steps "
        f"({_scale(summary, group)})",
        headers=(
            "variant",
            "seeds",
            f"{metrics.headline.label} [95% interval]",
            "error in a seed, spread of seeds",
            "IQM [95% interval]",
            *(each.label for each in others),
        ),
        rows=tuple(rows),
        caption=f"{_about(summary, group)}; {evaluation}. {_headline_note(metrics.headline)}"
        + _ERRORS
        + references_note(references),
    )


def channels_table(summary: Summary, group: Group) -> Table:
    """The headline of every arm of one group for each evaluated channel.

    A row for each arm, or, for as many channels as make a map, a row for each channel.
    """
    headline = summary.metrics(group.environment).headline
    arms = summary.arms_of(group)
    channels = sorted({row.channel for arm in arms for row in arm.rows})
    lines = [
        (
            arm.label,
            seeds_text(arm, rows := [arm.row(headline.name, channel) for channel in channels]),
            *map(_estimate, rows),
        )
        for arm in arms
    ]
    references = summary.references_of(group)
    lines += reference_rows(references, [(headline.name, each) for each in channels])
    headers = ("variant", "seeds", *(each.short for each in channels))
    if len(channels) >= MANY:
        headers, *lines = zip(headers, *lines, strict=True)
    shown = [row for arm in arms for row in arm.rows]
    about = _about(summary, group)
    if first := _first(shown):
        about += f"; {first}{shown[0].episodes:,} evaluation episodes per seed"
    return Table(
        title=f"{title_of(channels)}, {group.environment} ({_scale(summary, group)})",
        headers=headers,
        rows=tuple(lines),
        caption=f"{headline.label} [95% interval]; {about}. {_headline_note(headline)}"
        + references_note(references),
    )


def claims_table(verdicts: Sequence[Verdict]) -> Table:
    """Each claim, where it was tested, the difference with its interval, the verdict and why."""
    rows = []
    for verdict in verdicts:
        group = verdict.group
        rows.append(
            (
                f"{verdict.claim.says} ({verdict.claim.source})",
                f"{group.environment}, {group.train_env_steps:,} env steps, {group.profile}"
                if group
                else verdict.claim.environment,
                _compared(verdict),
                _with_interval(verdict.difference, verdict.interval),
                verdict.verdict,
                verdict.reason,
            )
        )
    return Table(
        title="Claims",
        headers=("claim", "tested on", "compared", "difference [95% interval]", "verdict", "why"),
        rows=tuple(rows),
        caption="A difference above 0 speaks for the claim. It is of all pairs of seeds, as its "
        f"interval is: inverted sign-flips, lowest to highest below {FEWEST} pairs. A verdict is "
        "of registered looks alone, by an exact sign-flip test that follows their paths: at most "
        "alpha of all studies decide a claim of its family of which nothing is true.",
    )


def to_markdown(table: Table) -> str:
    """The table as GitHub Markdown: heading, grid, caption; no text can break out of its cell."""
    lines = [table.headers, tuple("---" for _ in table.headers), *table.rows]
    grid = "\n".join("| " + " | ".join(map(_escape, line)) + " |" for line in lines)
    return f"### {_escape(table.title)}\n\n{grid}\n\n{_escape(table.caption)}\n"


def seeds_text(arm: Arm, rows: Sequence[Row | None]) -> str:
    """How many seeds count, and what became of the others: `3 (1 diverged)`.

    rows: the numbers beside it, which are of the seeds that were evaluated.
    """
    seeds = min([len(row.by_seed) for row in rows if row], default=len(arm.done))
    counts = {"failed": arm.failed, "diverged": arm.diverged, "unfinished": arm.unfinished}
    counts["not evaluated"] = len(arm.done) - seeds
    lost = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    return f"{seeds} ({lost})" if lost else str(seeds)


def _compared(verdict: Verdict) -> str:
    claim = verdict.claim
    label = claim.metric.replace("_", " ")
    when = "over training" if claim.measure == "learning" else "after training"
    through = f", {claim.channel.short}" if claim.channel != NONE_BROKEN else ""
    return f"{claim.better} against {claim.worse}: {label} {when}{through}"


def reference_label(name: str) -> str:
    """What tables and figures call a reference policy."""
    return f"({name})"


def reference_rows(
    references: References | None, columns: Sequence[tuple[str | None, Channel]]
) -> list[tuple[str, ...]]:
    """A row for each policy: its name, no seeds, and for each column its metric (None: a dash).

    They were played as they are, so a column of policies that act at an epsilon has none of them.
    """
    policies = references.policies if references else {}
    rows = []
    for name, policy in policies.items():
        values = [
            policy.metrics.get(metric) if metric and not channel.epsilon else None
            for metric, channel in columns
        ]
        cells = (NOTHING if value is None else _number(value) for value in values)
        rows.append((reference_label(name), NOTHING, *cells))
    return rows


def references_note(references: References | None) -> str:
    """Who the reference policies are."""
    if references is None:
        return ""
    who = "; ".join(
        f"{reference_label(name)} {policy.meaning}" for name, policy in references.policies.items()
    )
    return (
        " In brackets policies that learn nothing and use no links, "
        f"{references.episodes} episodes each: {who}."
    )


def _estimate(row: Row | None) -> str:
    return _with_interval(row.mean, row.interval) if row else NOTHING


def _errors(row: Row | None) -> str:
    """`0.4, 2.1`: of one seed over its episodes, and of the seeds."""
    if row is None:
        return NOTHING
    errors = (row.within, row.between)
    return ", ".join(NOTHING if each is None else _number(each) for each in errors)


def _mean(row: Row | None) -> str:
    return _number(row.mean) if row else NOTHING


def _with_interval(value: float | None, interval: Interval | None) -> str:
    """`10.2 [9.8, 10.6]`; the interval of a single seed is a dash."""
    if value is None:
        return NOTHING
    if interval is None:
        return f"{_number(value)} [{NOTHING}]"
    size = max(abs(value), abs(interval.low), abs(interval.high))
    low, high = (_number(end, size) for end in interval)
    return f"{_number(value, size)} [{low}, {high}]"


def _number(value: float, size: float | None = None) -> str:
    """As many decimals as a number of this size deserves, and no minus before a zero."""
    size = abs(value) if size is None else size
    text = f"{value:,.{0 if size >= 100 else 1 if size >= 10 else 2}f}"
    return text.removeprefix("-") if not any(c in "123456789" for c in text) else text


def _first(rows: Sequence[Row]) -> str:
    """What stands before the number of episodes where somebody has played more than are shown."""
    return "the first " if any(row.recorded > row.episodes for row in rows) else ""


def _about(summary: Summary, group: Group) -> str:
    overrides = ", ".join(summary.overrides_of(group))
    return (
        f"{group.environment}, profile {group.profile}, {group.train_env_steps:,} env steps a run"
        + (f", overridden: {overrides}" if overrides else "")
        + (f"; {origin}" if (origin := summary.origin_of(group)) else "")
    )


def _scale(summary: Summary, group: Group) -> str:
    """What stands in brackets behind a title."""
    return group.profile + (", overridden" if summary.overrides_of(group) else "")


def _headline_note(metric: NamedMetric) -> str:
    return (
        f"{metric.label} = {metric.formula}. Mean over seeds with 95% interval by inverted "
        f"sign-flips (below {FEWEST} seeds: lowest to highest), of the IQM by bootstrap from "
        f"{FEWEST_RESAMPLED} seeds on; failed and diverged runs have no value and are counted."
    )


def _escape(text: str) -> str:
    """Shown as it is: no HTML, and no link, picture, code or emphasis of Markdown."""
    for character, safe in {"&": "&amp;", "<": "&lt;", ">": "&gt;"}.items():
        text = text.replace(character, safe)
    return _MARKS.sub(r"\\\g<0>", " ".join(text.split()))
