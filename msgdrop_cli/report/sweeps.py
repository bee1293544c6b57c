"""A sweep as a table, as a figure and as numbers for other programs."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from msgdrop_cli.analysis.statistics import total
from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.analysis.sweeps import NEVER, Swept
from msgdrop_cli.definition.channel import played_how
from msgdrop_cli.definition.sweep import Sweep
from msgdrop_cli.report.bars import NO_EPSILON
from msgdrop_cli.report.captions import footer, scale
from msgdrop_cli.report.drawn import Drawn
from msgdrop_cli.report.figures import file_stem
from msgdrop_cli.report.looks import shown_arms
from msgdrop_cli.report.marks import end, label_ends, measure_axis
from msgdrop_cli.report.reference_lines import reference_lines
from msgdrop_cli.report.settings import own_settings
from msgdrop_cli.report.style import AXES, INK, LABEL, QUIET, Size, canvas
from msgdrop_cli.report.table import NOTHING, Table, reference_rows, references_note
from msgdrop_cli.report.write import Folder

_WIDTH, _RIGHT = AXES.width - 0.65, 1.65
"""Inches of the axes, and beside them, where the names stand."""


def sweep_table(summary: Summary, group: Group, sweep: Sweep, swept: Sequence[Swept]) -> Table:
    """Each arm at both ends and in the middle, its mean height, and where it falls below FDC."""
    metric = summary.metrics(group.environment).headline
    shown = sorted({0, len(sweep.values) // 2, len(sweep.values) - 1})
    rows = [
        (
            each.arm.label,
            str(len(each.areas)),
            *(f"{each.rows[place].mean:.1f}" for place in shown),
            f"{each.area:.1f} {_ends([f'{area:.1f}' for area in sorted(each.areas.values())])}",
            _fall(each),
        )
        for each in swept
    ]
    columns = [(metric.name, sweep.channels[place]) for place in shown]
    references = summary.references_of(group)
    # They use no links, so what they get at one setting is what they get over the range.
    rows += reference_rows(references, [*columns, columns[0], (None, sweep.channels[0])])
    origin = summary.origin_of(group)
    return Table(
        title=f"{sweep.text}, {scale(group)}",
        headers=(
            *("variant", "seeds"),
            *(sweep.channels[place].short for place in shown),
            "mean over the range [seeds]",
            "below FDC from [seeds]",
        ),
        rows=tuple(rows),
        caption=f"{metric.label} = {metric.formula}; {played_how(sweep.channels)}, "
        f"{_episodes(swept)}. [seeds]: the lowest and the highest, {NOTHING} of one; "
        f"FDC's is its own seed's.{f' {origin}.' if origin else ''}{references_note(references)}",
    )


def _fall(swept: Swept) -> str:
    if swept.fall is None:
        return NOTHING
    ends = [_place(fall) for fall in sorted(swept.falls.values())]
    return f"{_place(swept.fall)} {_ends(ends)}".rstrip()


def _ends(seeds: Sequence[str]) -> str:
    """`[low, high]` of sorted seeds; of a single one a dash, as in every table."""
    if len(seeds) == 1:
        return f"[{NOTHING}]"
    return f"[{seeds[0]}, {seeds[-1]}]" if seeds else ""


def _episodes(swept: Sequence[Swept]) -> str:
    count = swept[0].rows[0].episodes if swept else 0
    return f"{count:,} episodes a seed and setting"


def _place(value: float) -> str:
    return "never" if value == NEVER else f"{value:.3g}"


def write_sweep(
    summary: Summary, group: Group, sweep: Sweep, swept: Sequence[Swept], folder: Folder
) -> list[Path]:
    """Write the figure and its numbers; RecordError (73, 74) if they cannot be written."""
    name = "".join(letter if letter.isalnum() else "-" for letter in sweep.text).strip("-")
    stem = f"{file_stem(group)}-sweep-{name}"
    with own_settings():
        return draw_sweep(summary, group, sweep, swept).write(folder, stem)


def draw_sweep(summary: Summary, group: Group, sweep: Sweep, swept: Sequence[Swept]) -> Drawn:
    """Each arm's headline against the setting: the mean of the seeds, and every seed as a dot."""
    metric = summary.metrics(group.environment).headline
    looks = {id(each.arm): each for each in shown_arms(summary, group)}
    values = [seed for each in swept for row in each.rows for seed in row.by_seed.values()]
    lines = reference_lines(summary, group, metric, values)
    below = footer(
        summary,
        group,
        [each.arm for each in swept],
        f"{metric.label} = {metric.formula}; {played_how(sweep.channels)}, the same policies "
        f"and games at each setting, {_episodes(swept)}. Lines: mean over seeds. Dots: seeds. "
        f"Ticks below: where a mean falls below FDC's.{lines.note}"
        + (NO_EPSILON if lines.note and any(each.epsilon for each in sweep.channels) else ""),
    )
    ends = [
        end(shown.label, each.rows[-1].mean, shown.look.colour, shown.look.marker)
        for each in swept
        for shown in [looks[id(each.arm)]]
    ] + lines.ends
    size = Size(_WIDTH, max(AXES.height, total(each.height for each in ends)))
    figure, axes = canvas(f"{sweep.text}, {scale(group)}", below, size=size, right=_RIGHT)
    for each in swept:
        look = looks[id(each.arm)].look
        means = [row.mean for row in each.rows]
        axes.plot(
            sweep.values, means, color=look.colour, linestyle=look.line, marker=look.marker,
            linewidth=1.8, markersize=5.0, markeredgecolor="white", markeredgewidth=0.5, zorder=3,
        )  # fmt: skip
        for place, row in zip(sweep.values, each.rows, strict=True):
            seeds = list(row.by_seed.values())
            axes.scatter([place] * len(seeds), seeds, s=7, color=look.colour, alpha=0.45, zorder=2)
        if each.fall is not None and each.fall != NEVER:
            top = axes.get_xaxis_transform()
            axes.plot([each.fall] * 2, [0, 0.035], color=look.colour, transform=top, linewidth=2)
    axes.set_xlim(sweep.values[0], sweep.values[-1])
    axes.set_xlabel(sweep.name, fontsize=LABEL, color=INK)
    axes.tick_params(colors=QUIET)
    measure_axis(axes, metric, values)
    lines.draw(axes)
    label_ends(axes, ends)
    return Drawn(
        figure=figure,
        group=group,
        arms=[each.arm for each in swept],
        columns=("variant", "seed", "run_id", "channel", "setting", metric.name),
        rows=[line for each in swept for line in _lines(sweep, each)],
    )


def _lines(sweep: Sweep, swept: Swept) -> Iterator[Sequence[Any]]:
    """One line a seed and setting."""
    runs = {record.seed: record.run_id for record in swept.arm.done}
    for value, row in zip(sweep.values, swept.rows, strict=True):
        for seed, number in row.by_seed.items():
            who = (swept.arm.variant, seed, runs.get(seed))
            yield (*who, row.channel.key, f"{value:g}", number)
