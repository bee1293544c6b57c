"""The page as a file: everything escaped, nothing from elsewhere, never too large."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO

import numpy as np
from matplotlib.image import imread

from msgdrop_cli.analysis.reproduction import WORDS, Decides
from msgdrop_cli.definition.readings import all_readings
from msgdrop_cli.definition.statements import parse_register, read_register
from msgdrop_cli.report.page.content import Picture, decides, with_few_colours
from msgdrop_cli.report.page.elements import Html, el
from msgdrop_cli.report.page.html import LARGEST, html
from msgdrop_cli.report.page.markdown import markdown
from tests.cli_runs import ROOT
from tests.pages import page, png

STUDY = ROOT / "results" / "published" / "broken-links-two-million"
HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(2)>\"'&| `x` </td></table>"


class Elements(HTMLParser):
    """Every element of a page with its attributes, and the texts outside of script and style."""

    def __init__(self, content: bytes) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(content.decode())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep it."""
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        """Keep it."""
        self.texts.append(data)


def test_no_text_of_a_record_becomes_markup() -> None:
    """Labels, reasons, paths, machines: the same elements as with harmless ones."""
    harmless, hostile = Elements(html(page())), Elements(html(page(HOSTILE)))
    assert [tag for tag, _ in hostile.found if tag != "code"] == [
        tag for tag, _ in harmless.found if tag != "code"
    ]  # PAPER.md's backticks are code
    assert [*map(set, (a for _, a in hostile.found))].count({"src", "onerror"}) == 0
    assert sum(HOSTILE in text for text in hostile.texts) > 10


def test_markdown_of_hostile_texts_has_no_markup() -> None:
    """No tag, and no row with another number of cells."""
    text = markdown(page(HOSTILE)).decode()
    assert "<script" not in text
    assert "<img" not in text
    lines = markdown(page()).decode().splitlines()
    cells = [len(re.findall(r"(?<!\\)\|", line)) for line in text.splitlines()]
    assert cells == [line.count("|") for line in lines]


def test_the_page_asks_for_nothing() -> None:
    """Pictures are inside, links stay on the page, and the browser is told to refuse the rest."""
    found = Elements(html(page())).found
    sources = [a["src"] or "" for _, a in found if "src" in a]
    assert sources
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    links = [a["href"] or "" for _, a in found if "href" in a]
    ids = {a["id"] for _, a in found if "id" in a}
    assert {link.removeprefix("#") for link in links} <= ids
    [policy] = [a["content"] for _, a in found if "http-equiv" in a]
    assert policy is not None
    assert policy.startswith("default-src 'none'")


def test_every_id_is_there_once() -> None:
    """So a link leads to one row."""
    ids = [a["id"] for _, a in Elements(html(page())).found if "id" in a]
    assert len(ids) == len(set(ids))


def test_pictures_for_which_there_is_no_room_are_named() -> None:
    """The page stays below its limit."""
    sizes = {"large": 3_000_000, "larger": 3_100_000, "small": 0}
    pictures = tuple(Picture(name, name, png(more=more)) for name, more in sizes.items())
    content = html(replace(page(), pictures={"figure-6": pictures}))
    assert len(content) <= LARGEST
    shown = [a["alt"] for tag, a in Elements(content).found if tag == "img"]
    assert shown == ["large", "small"]
    assert b"larger: no room on a page of 5 MB; msgdrop plot draws it." in content


def test_the_same_records_give_the_same_bytes() -> None:
    """No clock, no chance."""
    assert html(page()) == html(page())


def test_all_words_are_counted() -> None:
    """And how many under another reading; claims of nobody's paper are not among them."""
    whole = page()
    assert list(whole.counts.values()) == [2, 1, 1, 1, 1, 1, 1]
    assert whole.under_readings()["contradicted"] == 1
    assert sum(whole.under_readings().values()) == 1
    others = [replace(line, papers=False) for line in whole.sections[0].lines]
    section = replace(whole.sections[0], lines=tuple(others))
    assert sum(replace(whole, sections=(section,)).counts.values()) == 0


def test_what_no_registered_question_gives_is_shown_only_where_it_is() -> None:
    """Six words, none of them left out for being 0, in every table and list; or all seven."""
    six = tuple(word for word in WORDS if word != "estimate")
    for shown in (WORDS, six):
        made = page(words=shown)
        assert made.words == [*shown]
        text = html(made).decode()
        assert re.findall(r'<button[^>]* data-word="([^"]*)"', text) == [*shown]
        assert ('<dt><span class="chip estimate' in text) == (shown == WORDS)
        assert f"| figure | {' | '.join(shown)} |" in markdown(made).decode()
    assert page(words=("supported",)).words == [*six]


def test_the_document_is_json() -> None:
    """With the test's numbers by their names."""
    document = json.loads(json.dumps(page().document(), allow_nan=False))
    assert document["counts"]["supported"] == 2
    [first, *_] = document["sections"][0]["lines"]
    assert first["readings"][0]["difference"] == 2.5
    assert first["decides"]["runs"] == 6


def test_a_look_that_may_well_not_decide_says_so_before_its_price() -> None:
    """Else the hopeless claims look cheapest."""
    way = Decides(
        seeds=14, forecast=False, registered=True, runs=8, seconds=1740.0, source="measured",
        unforeseen="as it stands 100 seeds would probably not decide",
    )  # fmt: skip
    assert decides(way) == (
        "as it stands 100 seeds would probably not decide; next look, 14 seeds: 8 runs more, "
        "29 min here"
    )
    assert decides(replace(way, runs=0)).startswith(f"{way.unforeseen}; 14 seeds, all trained")


def test_an_attribute_that_is_not_there_is_left_out() -> None:
    """None and False; True stands alone, and texts are escaped."""
    made = el("a", "<", Html("<b>"), href='"', hidden=True, title=None, open=False, data_x=1)
    assert made == '<a href="&quot;" hidden data-x="1">&lt;<b></a>'


def test_paper_md_is_read_as_it_stands() -> None:
    """Every registered reading has its statement; what no claim stands for is told."""
    register = read_register()
    assert {name for each in register.statements for name in each.readings} == set(all_readings())
    assert {each.chapter for each in register.statements if each.is_ours} >= {"Pursuit"}
    assert any("l. 460" in says for says, _ in register.unclaimed)
    assert all("no claim" in why for _, why in register.unclaimed)


def test_a_cell_may_hold_an_escaped_bar() -> None:
    """It is one cell."""
    rows = ("## Games", "| the paper says (line) | a | b | c | d |", "|---|---|---|---|---|")
    text = "\n".join([*rows, r"| x \|a\|^2 | y (ours) | code | test | - |"])
    [statement] = parse_register(text).statements
    assert statement.says == "x |a|^2"
    assert statement.is_ours


def test_few_colours_are_those_of_the_figure() -> None:
    """Bands that lie over each other have thousands; none is off by more than a sixteenth."""
    for file in sorted((STUDY / "figures").glob("*-learning.png")):
        content = file.read_bytes()
        few = with_few_colours(content)
        whole, small = (imread(BytesIO(each))[..., :3] for each in (content, few))
        assert np.abs(whole - small).max() <= 1 / 16
        assert (small[0] == 1.0).all()  # paper stays white
        assert len(few) < len(content) / 2
