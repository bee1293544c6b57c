"""The page as Markdown: the same tables, without pictures and colours."""

from msgdrop_cli.analysis.reproduction import Line, Section, counts
from msgdrop_cli.report.page.content import (
    MEANINGS,
    PAPER,
    Page,
    asked_under,
    decides,
    game,
    interval,
    number,
    p_text,
    scale,
)
from msgdrop_cli.report.table import NOTHING, Table, to_markdown

_HEADERS = (
    *("claim", "compared", "reading", "difference [95%]", "p (least)", "seeds", "verdict"),
    *("what would decide", "command"),
)


def markdown(page: Page) -> bytes:
    """The whole file."""
    altered = [_altered(page)] if page.altered else []
    tables = [*altered, _counts(page), _overview(page), *map(_claims, page.sections)]
    tables += [_unclaimed(page), _deviations(page), _dropped(page), _makers(page)]
    head = f"# Message-Dropout, claim by claim\n\n{PAPER}.\n"
    return "\n".join([head, *map(to_markdown, tables)]).encode()


def _altered(page: Page) -> Table:
    return Table(
        title="Published files that differ from the list beside them",
        headers=("where",),
        rows=tuple((each,) for each in page.altered),
        caption="",
    )


def _counts(page: Page) -> Table:
    other = page.under_readings()
    return Table(
        title="The paper's claims by their word",
        headers=("word", "claims", "of these under another reading", "meaning"),
        rows=tuple(
            (word, str(page.counts[word]), str(other[word]), MEANINGS[word]) for word in page.words
        ),
        caption=page.times(),
    )


def _overview(page: Page) -> Table:
    rows = [
        (section.title, *(str(counts(section.lines)[word]) for word in page.words))
        for section in page.sections
    ]
    headers = ("figure", *page.words)
    return Table(title="Figure by figure", headers=headers, rows=tuple(rows), caption="")


def _claims(section: Section) -> Table:
    return Table(
        title=section.title,
        headers=_HEADERS,
        rows=tuple(row for line in section.lines for row in _rows(line)),
        caption=f"{section.asks} ({section.source}). Registered as {section.registered}.",
    )


def _rows(line: Line) -> list[tuple[str, ...]]:
    """The claim with the reading that says its word, then the other readings."""
    first = line.shown
    readings = [first, *(each for each in line.readings if each is not first)] if first else [None]
    rows: list[tuple[str, ...]] = []
    for each in readings:
        evidence = each.evidence if each else None
        p = NOTHING
        if evidence:
            p = f"{p_text(evidence.p)} ({p_text(evidence.smallest_p)})"
        rows.append(
            (
                f"{line.says} ({line.source})",
                f"{line.better_label} beats {line.worse_label}: {game(line)}",
                f"{asked_under(each.readings)}: {scale(each)}" if each else NOTHING,
                f"{number(each.difference)} {interval(each)}".strip() if each else NOTHING,
                p,
                str(each.seeds) if each else NOTHING,
                line.word if each is first else (each.word if each else line.word),
                decides(line.decides) or NOTHING if each is first else NOTHING,
                each.command if each else line.command,
            )
        )
    return rows


def _unclaimed(page: Page) -> Table:
    return Table(
        title="Said, and judged by nothing",
        headers=("the paper says", "why no claim stands for it"),
        rows=page.register.unclaimed,
        caption="",
    )


def _deviations(page: Page) -> Table:
    rows = [
        (each.chapter, each.says, each.read_as, each.if_wrong, ", ".join(each.readings))
        for each in page.register.statements
        if each.is_ours
    ]
    return Table(
        title="How the paper is read (PAPER.md)",
        headers=("chapter", "the paper says", "we read it as", "if that is wrong", "readings"),
        rows=tuple(rows),
        caption="",
    )


def _dropped(page: Page) -> Table:
    return Table(
        title="Left out, and why",
        headers=("run", "what", "runs", "why"),
        rows=tuple((each.name, each.what, str(each.runs), each.reason) for each in page.dropped),
        caption="",
    )


def _makers(page: Page) -> Table:
    rows = [
        (
            *(each.host, each.device, each.kernel, each.torch, str(each.runs)),
            *(f"{each.env_steps:,}", f"{each.hours:.1f}", ", ".join(each.commits)),
        )
        for each in page.makers
    ]
    headers = ("machine", "device", "kernel", "torch", "runs", "env steps", "hours", "commits")
    return Table(
        title="Machines, kernels, commits",
        headers=headers,
        rows=tuple(rows),
        caption=f"Made by msgdrop {page.version} of the records in {page.folder}"
        f"{f'; {page.origin}' if page.origin else ''}.",
    )
