"""What policies that learn nothing get, as dotted lines: a curve means little without them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgdrop_cli.analysis.metrics import NamedMetric
from msgdrop_cli.analysis.summary import Group, Summary
from msgdrop_cli.report.lettering import drawable_name
from msgdrop_cli.report.marks import End, end
from msgdrop_cli.report.style import QUIET
from msgdrop_cli.report.table import reference_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FARTHEST = 0.5
"""A line farther off than this share of the data's span would squeeze the data; it is told."""


@dataclass(frozen=True, slots=True)
class ReferenceLines:
    """The lines of one figure."""

    shown: Mapping[str, float]
    note: str
    """The words about them that the footer takes; empty without any."""

    @property
    def ends(self) -> list[End]:
        """Their names, for the right margin."""
        return [end(label, height, QUIET) for label, height in self.shown.items()]

    def draw(self, axes: "Axes") -> None:
        """Draw the lines, with the axis long enough for them."""
        low, high = axes.get_ylim()
        heights = self.shown.values()
        gap = 0.04 * (high - low)
        axes.set_ylim(
            low if min(heights, default=low) >= low else min(heights) - gap,
            high if max(heights, default=high) <= high else max(heights) + gap,
        )
        for height in heights:
            axes.axhline(height, color=QUIET, linewidth=1.0, linestyle=(0, (1, 2)), zorder=1.5)


def reference_lines(
    summary: Summary, group: Group, metric: NamedMetric, values: Sequence[float]
) -> ReferenceLines:
    """The reference policies of a group, beside data with these values."""
    references = summary.references_of(group)
    if references is None or not values:
        return ReferenceLines({}, "")
    low, high = min(values), max(values)
    low = low if low < 0.0 else 0.0  # as the axis
    reach = FARTHEST * (high - low)
    shown, told = {}, []
    for name, policy in references.policies.items():
        value, label = policy.metrics.get(metric.name), drawable_name(reference_label(name))
        if value is None:
            continue
        if low - reach <= value <= high + reach:
            shown[label] = value
        else:
            told.append(f"{label} {value:.3g}")
    which = "Dotted: policies" if shown else "Policies"
    note = f" {which} that learn nothing, {references.episodes} episodes each."
    return ReferenceLines(shown, note + (f" Not drawn: {', '.join(told)}." if told else ""))
