"""Where numbers come from, and what is in none of them: machines, commits, hours, dropped runs."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from msgdrop_cli.analysis.labels import with_overrides
from msgdrop_cli.analysis.statistics import total
from msgdrop_cli.records.store import RunRecord

_UNKNOWN = "?"


@dataclass(frozen=True, slots=True, kw_only=True)
class Maker:
    """Runs that one kind of machine has trained with one kernel."""

    host: str
    device: str
    kernel: str
    torch: str
    commits: tuple[str, ...]
    """`+` where files differed from it."""
    runs: int
    env_steps: int
    hours: float
    """Of training, run by run: those that trained stacked in one process had theirs together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dropped:
    """Runs that are in no number, or count as the worst value."""

    what: str
    """failed, diverged, unfinished, unreadable, or of no claim."""
    name: str
    """The run's folder; a question and variant for runs of no claim."""
    runs: int
    reason: str


def makers(records: Sequence[RunRecord]) -> tuple[Maker, ...]:
    """The machines behind finished runs, those with the most runs first."""
    alike: dict[tuple[str, ...], list[RunRecord]] = defaultdict(list)
    for record in records:
        if record.status == "done":
            versions = record.run.get("versions")
            torch = versions.get("torch") if isinstance(versions, dict) else None
            named = [record.run.get(key) for key in ("host", "device", "kernel")]
            alike[tuple(str(each or _UNKNOWN) for each in (*named, torch))].append(record)
    found = [
        Maker(
            host=host,
            device=device,
            kernel=kernel,
            torch=torch,
            commits=tuple(sorted({short_commit(record.run.get("commit")) for record in runs})),
            runs=len(runs),
            env_steps=sum(record.env_steps for record in runs),
            hours=total(float(record.run["wall_time_s"]) for record in runs) / 3600.0,
        )
        for (host, device, kernel, torch), runs in alike.items()
    ]
    return tuple(sorted(found, key=lambda maker: (-maker.runs, maker.host, maker.kernel)))


def studies(records: Iterable[RunRecord]) -> str:
    """`broken-links-two-million (40), ...`: the folders that published runs lie in."""
    found = Counter("".join(record.path.resolve().parts[-3:-2]) for record in records)
    return ", ".join(f"{name} ({count:,})" for name, count in found.items())


def origin(records: Sequence[RunRecord]) -> str:
    """`48 of 60 runs published: dropout-rate-two-million (48)`; empty if all are own ones."""
    published = [record for record in records if not record.is_own]
    if not published:
        return ""
    return f"{len(published):,} of {len(records):,} runs published: {studies(published)}"


def lost_runs(records: Iterable[RunRecord]) -> list[Dropped]:
    """The runs that answer a question and are not finished."""
    words = {"failed": "failed", "diverged": "diverged"}
    return [
        Dropped(
            what=words.get(record.status, "unfinished"),
            name=str(record.path),
            runs=1,
            reason=record.reason or f"{record.status}, {record.env_steps:,} env steps",
        )
        for record in records
        if record.status != "done"
    ]


def runs_of_no_claim(records: Iterable[RunRecord]) -> list[Dropped]:
    """Runs that no shipped question plans, counted by what they call themselves."""
    found = Counter(
        (
            f"{record.definition}, {record.profile}: {record.environment}, "
            + with_overrides(record.label, record.variant, record.overrides)
        )
        for record in records
    )
    reason = "no shipped question plans runs with these settings"
    return [
        Dropped(what="of no claim", name=name, runs=runs, reason=reason)
        for name, runs in sorted(found.items())
    ]


def short_commit(commit: object) -> str:
    """Its first seven letters, and the `+` of a tree with changes; `?` if it is unknown."""
    text = str(commit or _UNKNOWN)
    return text[:7] + "+" * text.endswith("+")
