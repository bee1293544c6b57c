"""The page as one HTML file that asks the network for nothing: style, script, pictures are inside.

It can be read without its script, which filters, sorts and copies.
"""

from base64 import b64encode
from importlib import resources

import msgdrop_cli.report.page
from msgdrop_cli.analysis.reproduction import WORDS, Section, counts
from msgdrop_cli.report.page.about import about, table
from msgdrop_cli.report.page.claims import chip, claims_table
from msgdrop_cli.report.page.content import PAPER, Page, Picture, game
from msgdrop_cli.report.page.elements import Html, el

LARGEST = 5_000_000
"""Bytes of a page: pictures for which there is no more room are named instead."""
_TITLE = "Message-Dropout, claim by claim"
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
"""What a browser is told to refuse: anything from elsewhere."""


def html(page: Page) -> bytes:
    """The whole file, of at most LARGEST bytes as far as pictures are concerned."""
    frame = _file(page, {})
    room = LARGEST - len(frame)
    shown: dict[str, Html] = {}
    for section in page.sections:
        for picture in page.pictures.get(section.key, ()):
            image = _image(picture)
            if len(image) <= room:
                shown[f"{section.key}/{picture.name}"] = image
                room -= len(image)
    return _file(page, shown)


def _file(page: Page, shown: dict[str, Html]) -> bytes:
    body = [
        el("a", "Skip to the claims", href="#claims", class_="skip"),
        _header(page),
        el("main", *(_section(each, page, shown) for each in page.sections), id="claims"),
        *about(page),
        el("footer", el("p", PAPER)),
        el("script", Html(_asset("page.js"))),
    ]
    head = [
        Html('<meta charset="utf-8">'),
        el("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        el("meta", name="viewport", content="width=device-width, initial-scale=1"),
        el("meta", name="color-scheme", content="light dark"),
        el("title", _TITLE),
        el("style", Html(_asset("page.css"))),
    ]
    document = el("html", el("head", *head), el("body", *body), lang="en")
    return f"<!DOCTYPE html>\n{document}\n".encode()


def _asset(name: str) -> str:
    return (resources.files(msgdrop_cli.report.page) / name).read_text("utf-8")


def _header(page: Page) -> Html:
    papers = [line for line in page.lines if line.papers]
    sentences = len({(line.says, line.source) for line in papers})
    runs = sum(each.runs for each in page.makers)
    orderings = len({(line.better, line.worse, game(line), line.metric) for line in papers})
    lede = (
        f"{len(papers)} claims in {sentences} sentences of the paper ({orderings} different "
        f"orderings: some are asked by two questions), against {runs} finished runs. A verdict is "
        "given at registered looks only, by an exact test; what is open says what would decide it."
    )
    others = len(page.lines) - len(papers)
    also = f" {others} more, at the end, are not of the paper." if others else ""
    return el(
        "header",
        el("p", "msgdrop reproduce", class_="eyebrow"),
        el("h1", _TITLE),
        el("p", lede + also, class_="lede"),
        *(el("p", each, class_="warn") for each in page.altered),
        _counts(page),
        el("form", el("label", "Find ", el("input", type="search", id="find", autocomplete="off",
           placeholder="navigation learns, l. 528, md-0.5, nearest …")),
           el("output", "", id="found", aria_live="polite"), class_="js", role="search"),
        _overview(page),
    )  # fmt: skip


def _counts(page: Page) -> Html:
    other = page.under_readings()
    items = []
    for word in page.words:
        inside = [el("b", str(page.counts[word])), chip(word)]
        if other[word]:
            inside.append(el("small", f"{other[word]} under {page.other_readings()}"))
        button = el("button", *inside, type="button", data_word=word, aria_pressed="false")
        items.append(el("li", button))
    return el("ul", *items, class_="counts", aria_label="Claims by verdict; a click filters them")


def _overview(page: Page) -> Html:
    heads = [el("th", "figure", scope="col", data_sort="text"),
             el("th", "shows", scope="col", data_sort="text")]  # fmt: skip
    heads += [el("th", word, scope="col", data_sort="number") for word in page.words]
    rows = []
    for section in page.sections:
        name, _, shows = section.title.partition(": ")
        cells = [el("td", shows or section.asks, class_="shows")]
        found = counts(section.lines)
        for word in page.words:
            count = found[word]
            kind = word.replace(" ", "-") if count else "none"
            cells.append(
                el("td", str(count) if count else "·", data_v=str(count), data_label=word,
                   class_=f"count {kind}")
            )  # fmt: skip
        link = el("a", name, href=f"#{section.key}")
        rows.append(el("tr", el("th", link, scope="row", data_v=section.key), *cells))
    inside = el("table", el("caption", "Figure by figure"), el("thead", el("tr", *heads)),
                el("tbody", *rows), class_="overview")  # fmt: skip
    return el("nav", inside, aria_label="Figures")


def _section(section: Section, page: Page, shown: dict[str, Html]) -> Html:
    name, _, shows = section.title.partition(": ")
    parts = [
        el("h2", name, *([" ", el("span", shows)] if shows else [])),
        el("p", f"{section.asks} ", el("cite", section.source), ". ", _registered(section),
           class_="about"),
        claims_table(section, [*WORDS]),
    ]  # fmt: skip
    pictures = page.pictures.get(section.key, ())
    figures = [_figure(each, shown.get(f"{section.key}/{each.name}")) for each in pictures]
    if figures:
        parts.append(el("div", *figures, class_="figures"))
    else:
        parts.append(el("p", "No finished run, so no figure.", class_="note"))
    if tables := page.tables.get(section.key, ()):
        summary = el("summary", f"numbers of every variant ({len(tables)})")
        parts.append(el("details", summary, *map(table, tables), class_="tables"))
    return el("section", *parts, id=section.key, class_="figure")


def _registered(section: Section) -> str:
    rule = section.registration
    if rule is None:
        return "Nothing is registered, so there are estimates and no verdicts."
    looks = ", ".join(map(str, rule.looks))
    alphas = ", ".join(f"{alpha:g}" for alpha in rule.alpha_spent)
    margins = ", ".join(f"{m:g} {each.replace('_', ' ')}" for each, m in rule.margin.items())
    sides = "both sides" if rule.sides == 2 else "one side"
    seen = {each: rule.in_game(each).seen for each in section.environments}
    alike = len({*seen.values()}) == 1
    before = [f"{n} seeds{'' if alike else f' of {each}'}" for each, n in seen.items() if n]
    told = ", ".join(dict.fromkeys(before))
    gone = f" Up to {told} had been seen before: that alpha is spent." if before else ""
    level = f", level within {margins}" if margins else ""
    return f"Registered: looks at {looks} seeds, alpha spent {alphas}, {sides}{level}.{gone}"


def _figure(picture: Picture, image: Html | None) -> Html:
    left_out = f"{picture.name}: no room on a page of 5 MB; msgdrop plot draws it."
    return el("figure", image or el("p", left_out), el("figcaption", picture.alt))


def _image(picture: Picture) -> Html:
    """With its size, so that nothing moves when it is shown."""
    width, height = (int.from_bytes(picture.png[at : at + 4]) for at in (16, 20))
    data = b64encode(picture.png).decode()
    return el("img", src=f"data:image/png;base64,{data}", alt=picture.alt, width=width,
              height=height, loading="lazy")  # fmt: skip
