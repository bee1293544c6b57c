"""The published studies as the sentences need them: one number, estimate or verdict at a time."""

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from msgdrop_cli.analysis.claims import judge_claims
from msgdrop_cli.analysis.curves import learning_mean
from msgdrop_cli.analysis.intervals import mean_interval
from msgdrop_cli.analysis.statistics import Interval, mean
from msgdrop_cli.analysis.summary import Arm, Row, Summary, summarise
from msgdrop_cli.analysis.verdict import Evidence, Verdict
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.definition.judged import judged_at
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.spec import Registration
from msgdrop_cli.records.elsewhere import runs_of
from msgdrop_cli.records.references import find_references, game_key
from msgdrop_cli.records.remembering import remembering

PUBLISHED = Path(__file__).parents[2] / "results" / "published"
SIX, EIGHT = "pursuit-n6", "pursuit-n8"
NONE, HALF, ALL = NONE_BROKEN, Channel.read(0.5), Channel.read(1.0)
_WIDTH = 100
_INTERVAL = re.compile(r"\S+ \[[-\d., ]+\]")
_NUMBERS = (
    *("no", "one", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve"),
)
_ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth")


class Estimate(NamedTuple):
    """A mean over seeds and its 95% interval."""

    mean: float
    interval: Interval | None

    @property
    def negated(self) -> "Estimate":
        """How much worse, of a difference below 0."""
        low, high = self.interval or (self.mean, self.mean)
        return Estimate(-self.mean, self.interval and Interval(-high, -low))

    def text(self, decimals: int | None = None) -> str:
        """`15.1 [13.8, 16.4]`; None: no decimals from 100 on, one below."""
        ends = self.interval or ()
        if decimals is None:
            decimals = 0 if max(map(abs, (self.mean, *ends))) >= 100.0 else 1
        words = [_fixed(value, decimals) for value in (self.mean, *ends)]
        return f"{words[0]} [{', '.join(words[1:])}]" if ends else words[0]


class Study(NamedTuple):
    """One published folder."""

    summary: Summary
    verdicts: Sequence[Verdict]
    registration: Registration

    def arm(self, variant: str, environment: str | None = None) -> Arm:
        """The runs of a variant, which has one set-up in each game."""
        [arm] = [
            arm
            for arm in self.summary.arms
            if arm.variant == variant and environment in (None, arm.group.environment)
        ]
        return arm

    def after(
        self,
        variant: str,
        channel: Channel = NONE_BROKEN,
        *,
        metric: str | None = None,
        environment: str | None = None,
    ) -> Estimate:
        """What the greedy policies do after training; of the headline if no metric is named."""
        row = self._row(variant, channel, metric, environment)
        return Estimate(row.mean, row.interval)

    def episodes(self, variant: str) -> int:
        """Of each evaluation."""
        return self._row(variant, NONE_BROKEN, None, None).episodes

    def in_training(self, variant: str) -> Estimate:
        """The headline over the whole training of the exploring policies."""
        arm = self.arm(variant)
        metric = arm.metrics.headline.name
        values = [learning_mean(record, metric) or 0.0 for record in arm.done]
        return Estimate(mean(values), mean_interval(values))

    def windows(
        self, variant: str, first: int, last: int, metric: str | None = None
    ) -> Mapping[int, float]:
        """Each seed's mean over its windows of training from env step `first` to `last`."""
        arm = self.arm(variant)
        name = metric or arm.metrics.headline.name
        return {
            record.seed: mean([row[name] for row in rows])
            for record in arm.done
            if (rows := [r for r in record.metrics() if first < r["env_steps"] <= last])
        }

    def reference(
        self, name: str, metric: str | None = None, environment: str | None = None
    ) -> float:
        """What a policy that learns nothing does, 0 where it has nothing to measure."""
        [group] = [each for each in self.summary.groups if environment in (None, each.environment)]
        known = self.summary.references_of(group)
        headline = self.summary.metrics(group.environment).headline.name
        return (known.policies[name].metrics[metric or headline] or 0.0) if known else 0.0

    def verdict(
        self,
        better: str,
        worse: str,
        channel: Channel = NONE_BROKEN,
        *,
        environment: str | None = None,
        measure: str = "evaluation",
    ) -> Verdict:
        """That of one comparison."""
        asked = (better, worse, channel, measure)
        [verdict] = [
            each
            for each in self.verdicts
            if asked
            == (each.claim.better, each.claim.worse, each.claim.channel, each.claim.measure)
            and environment in (None, each.claim.environment)
        ]
        return verdict

    def _row(
        self, variant: str, channel: Channel, metric: str | None, environment: str | None
    ) -> Row:
        arm = self.arm(variant, environment)
        row = arm.row(metric or arm.metrics.headline.name, channel)
        if row is None:
            raise ValueError(f"{variant} was not evaluated with {channel.label}")
        return row


@cache
def study(folder: str, environment: str | None = None) -> Study:
    """A folder of results/published, measured and judged; environment: its part in that game."""
    path = PUBLISHED / folder
    records = remembering(
        [each for each in runs_of(path).records if environment in (None, each.environment)], None
    )
    definition = load_definition(records[0].definition)
    keys = {game_key(record.spec["environment"]) for record in records}
    known = {key: find_references(path, key) for key in keys}
    summary = summarise(
        records,
        order=tuple(definition.variants),
        references={key: each for key, each in known.items() if each},
    )
    claims = [
        claim
        for claim in judged_at(definition, records[0].profile)
        if environment in (None, claim.environment)
    ]
    if definition.registration is None:
        raise ValueError(f"{definition.name} has registered nothing")
    verdicts = judge_claims(claims, summary, definition)
    return Study(summary, verdicts, definition.registration)


def difference(verdict: Verdict) -> Estimate:
    """Better minus worse."""
    if verdict.difference is None:
        raise ValueError(f"{verdict.claim.better} was not compared with {verdict.claim.worse}")
    return Estimate(verdict.difference, verdict.interval)


def share(rule: Registration, look: int) -> str:
    """What a look after the first may spend of alpha: what is spent by it, less that before."""
    return f"{rule.alpha_spent[look - 1] - rule.alpha_spent[look - 2]:.3f}"


def evidence(verdict: Verdict) -> Evidence:
    """What the look was that decided it, or that did not yet."""
    if verdict.evidence is None:
        raise ValueError(f"nobody looked at {verdict.claim.better} against {verdict.claim.worse}")
    return verdict.evidence


def expect(is_so: bool, sentence: str) -> None:
    """Refuse to write a sentence that the records no longer say."""
    if not is_so:
        raise ValueError(f"the records do not say any more: {sentence}; write that text anew")


def paragraph(text: str) -> str:
    """The text in lines as long as the others; no interval is broken."""
    whole = _INTERVAL.sub(lambda each: each[0].replace(" ", "\0"), " ".join(text.split()))
    lines = textwrap.fill(whole, _WIDTH, break_long_words=False, break_on_hyphens=False)
    return lines.replace("\0", " ")


def table(headers: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table of GitHub's Markdown."""
    head, *body = (f"| {' | '.join(line)} |" for line in (headers, *rows))
    return "\n".join([head, "|---" * head.count(" | ") + "|---|", *body])


def while_and_after(found: Study, labels: Mapping[str, str]) -> str:
    """Each variant's headline while it learns, and of its greedy policies after that."""
    rows = (
        (label, found.in_training(variant).text(1), found.after(variant).text(1))
        for variant, label in labels.items()
    )
    return table(("variant", "mean of the training", "greedy, after training"), rows)


def side_by_side(found: Mapping[str, Study], labels: Mapping[str, str]) -> str:
    """The same of two studies, one column each: `found` says how each reads the paper."""
    first, second = found
    rows = (
        (
            label,
            *(each.in_training(variant).text(1) for each in found.values()),
            *(each.after(variant).text(1) for each in found.values()),
        )
        for variant, label in labels.items()
    )
    headers = (f"in training, {first}", second, f"after it, {first}", second)
    return table(("variant", *headers), rows)


def number(count: int) -> str:
    """A small number as a word."""
    return _NUMBERS[count] if count < len(_NUMBERS) else f"{count:,}"


def ordinal(count: int) -> str:
    """1 is the first."""
    return _ORDINALS[count - 1]


def listing(words: Sequence[str]) -> str:
    """`a, b and c`."""
    return " and ".join([*([", ".join(words[:-1])] if words[:-1] else []), words[-1]])


def _fixed(value: float, decimals: int) -> str:
    """With so many decimals, and no minus before a zero."""
    text = f"{value:,.{decimals}f}"
    return text.removeprefix("-") if not any(each in "123456789" for each in text) else text
