"""What stands below the claims: how the paper is read, what is left out, who computed it."""

from collections.abc import Iterable, Sequence
from itertools import groupby

from msgdrop_cli.analysis.provenance import Dropped, short_commit
from msgdrop_cli.analysis.statistics import total
from msgdrop_cli.definition.statements import Statement
from msgdrop_cli.report.page.claims import chip
from msgdrop_cli.report.page.content import MEANINGS, Page
from msgdrop_cli.report.page.elements import Html, el, join
from msgdrop_cli.report.table import Table


def about(page: Page) -> list[Html]:
    """The sections, in their order."""
    return [
        _unclaimed(page),
        _deviations(page),
        _dropped(page.dropped),
        _makers(page),
        _words(page),
    ]


def grid(headers: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "") -> Html:
    """A plain table; the first cell of a row is its heading."""
    head = el("thead", el("tr", *(el("th", header, scope="col") for header in headers)))
    body = [
        el("tr", el("th", first, scope="row"),
           *(el("td", cell, data_label=name)
             for cell, name in zip(others, headers[1:], strict=True)))
        for first, *others in rows
    ]  # fmt: skip
    shown = [el("caption", caption)] if caption else []
    return el("div", el("table", *shown, head, el("tbody", *body), class_="grid"), class_="wide",
              tabindex="0", role="region", aria_label=caption or headers[0])  # fmt: skip


def table(shown: Table) -> Html:
    """A table as terminals show it, with its caption below."""
    return join(grid(shown.headers, shown.rows, shown.title), el("p", shown.caption, class_="note"))


def _unclaimed(page: Page) -> Html:
    rows = page.register.unclaimed
    inside = (
        grid(("the paper says", "why no claim stands for it"), rows) if rows else _no_register()
    )
    return el("section", el("h2", "Said, and judged by nothing"), inside, id="unclaimed")


def _no_register() -> Html:
    return el("p", "PAPER.md did not come with this program, so this is not known here.")


def _deviations(page: Page) -> Html:
    statements = page.register.statements
    ours = [each for each in statements if each.is_ours]
    parts: list[Html] = [el("h2", "How the paper is read")]
    if not statements:
        return el("section", *parts, _no_register(), id="deviations")
    parts.append(
        el("p", f"Of {len(statements)} statements of the paper that are read here (PAPER.md) "
           f"{len(ours)} are choices of ours or have another reading. A reading with a name can be "
           "asked: ", el("code", "msgdrop ablate QUESTION --reading NAME"), ".")
    )  # fmt: skip
    for chapter, rows in groupby(ours, key=lambda each: each.chapter):
        listed = list(rows)
        cells = [_deviation(each, page) for each in listed]
        headers = ("the paper says (line)", "we read it as", "if that is wrong", "other readings")
        summary = el("summary", f"{chapter} ({len(listed)})")
        parts.append(el("details", summary, grid(headers, cells)))
    return el("section", *parts, id="deviations")


def _deviation(each: Statement, page: Page) -> tuple[str, ...]:
    others = [
        join(el("code", name), f": {page.readings.get(name, '')}", el("br"))
        for name in each.readings
    ]
    return _plain(each.says), _marked(each.read_as), _plain(each.if_wrong), join(*others)


def _plain(text: str) -> str:
    return text.replace("`", "")


def _marked(text: str) -> Html:
    """Markdown's code as code."""
    parts = text.split("`")
    return join(*(el("code", part) if odd % 2 else part for odd, part in enumerate(parts)))


def _dropped(dropped: Sequence[Dropped]) -> Html:
    rows = [(each.name, each.what, str(each.runs), each.reason) for each in dropped]
    inside = el("p", "Nothing: every run that was found is finished, readable and of a claim.")
    if rows:
        inside = join(
            el("p", "Failed and diverged runs count as the worst value in every difference of "
               "their arm, the failed ones in no look. The others are in no number."),
            grid(("run", "what", "runs", "why"), rows),
        )  # fmt: skip
    return el("section", el("h2", "Left out, and why"), inside, id="dropped")


def _makers(page: Page) -> Html:
    headers = ("machine", "device", "kernel", "torch", "runs", "env steps", "hours", "commits")
    rows = [
        (
            each.host,
            each.device,
            each.kernel,
            each.torch,
            str(each.runs),
            f"{each.env_steps:,}",
            f"{each.hours:.1f}",
            ", ".join(each.commits),
        )
        for each in page.makers
    ]
    hours = total(each.hours for each in page.makers)
    count = sum(each.runs for each in page.makers)
    made = f"msgdrop {page.version}" + (
        f" at commit {short_commit(page.commit)}" if page.commit else ""
    )
    parts = [
        el("p", f"{count} runs took {hours:.1f} hours to train, counted run by run: stacked ones, "
           f"as on a GPU, had theirs together. {made} made this page of the records in ",
           el("code", page.folder), f"; {page.origin}." if page.origin else "."),
    ]  # fmt: skip
    if rows:
        parts.append(grid(headers, rows))
    return el("section", el("h2", "Machines, kernels, commits"), *parts, id="machines")


def _words(page: Page) -> Html:
    terms = [join(el("dt", chip(word)), el("dd", f"{MEANINGS[word]}.")) for word in page.words]
    rule = (
        "Arms of one seed meet the same games, so a claim is a row of paired differences. An exact "
        "sign-flip test follows them along the registered looks, together with the other claims of "
        "its family; p is of the claim alone at its look, “family” the step-down maximum, “least” "
        "the smallest that p can be with so many seeds. The interval is what the test does not "
        "reject (of fewer than six seeds lowest to highest, dashed); the band around zero is the "
        "margin of level. Of several scales of one reading the largest counts that has reached a "
        f"registered look. {page.times()}"
    )
    return el("section", el("h2", "How the words come about"), el("dl", *terms), el("p", rule),
              id="words")  # fmt: skip
