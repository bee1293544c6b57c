"""The page in a real browser: quiet, offline, and as good with a keyboard or on a phone."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from msgdrop_cli.report.page.html import html
from tests.browser import CHROMIUM, Browser, browser
from tests.pages import page

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
CLAIMS = ".filter(claim => !claim.hidden && claim.checkVisibility()).map(claim => claim.id)"
SHOWN = f"[...document.querySelectorAll('.claim')]{CLAIMS}"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page on disk."""
    path = tmp_path_factory.mktemp("page") / "reproduce.html"
    path.write_bytes(html(page()))
    return path


@pytest.fixture(scope="module")
def tab(file: Path) -> Iterator[Browser]:
    """A browser that shows it."""
    with browser() as found:
        yield found


def test_nothing_is_asked_for_and_nothing_is_complained_of(tab: Browser, file: Path) -> None:
    """The file itself, and no word on the console."""
    tab.open(file)
    assert tab.requests() == [file.as_uri()]
    assert tab.complaints() == []


def test_a_complaint_would_be_noticed(tab: Browser, tmp_path: Path) -> None:
    """The test before this one can fail."""
    other = tmp_path / "other.html"
    script = "<script>console.error(1); nothing()</script>"
    other.write_text(f"<img src='http://127.0.0.1:9/x.png'>{script}")
    tab.open(other)
    assert len(tab.requests()) == 2
    assert len(tab.complaints()) >= 2


def test_every_figure_is_seen(tab: Browser, file: Path) -> None:
    """Each picture is drawn when one gets there."""
    tab.open(file)
    loaded = """Promise.all([...document.images].map(async image => {
        image.scrollIntoView(); await image.decode();
        return image.naturalWidth > 0 && image.getBoundingClientRect().width > 0; }))"""
    assert tab.says(loaded) == [True, True]


def test_a_word_filters_and_lets_go(tab: Browser, file: Path) -> None:
    """One word, two words, none again; sections without a claim go, and the count says so."""
    tab.open(file)
    click = "document.querySelector(`.counts [data-word='{}']`).click()"
    tab.says(click.format("level"))
    assert tab.says(SHOWN) == ["figure-6-3"]
    assert tab.says("document.getElementById('found').textContent") == "1 of 8 claims"
    assert tab.says("document.getElementById('figure-7').checkVisibility()") is False
    tab.says(click.format("not run"))
    assert tab.says(SHOWN) == ["figure-6-3", "figure-6-7"]
    tab.says(click.format("level"))
    tab.says(click.format("not run"))
    assert len(tab.says(SHOWN)) == 8


def test_a_sentence_finds_its_row(tab: Browser, file: Path) -> None:
    """Its words in any order and case, with the line; nonsense finds nothing."""
    tab.open(file)
    search = """(() => { const find = document.getElementById('find'); find.value = %r;
        find.dispatchEvent(new Event('input')); })()"""
    tab.says(search % "no. 4 DROPOUT l. 528")
    assert tab.says(SHOWN) == ["figure-6-4"]
    tab.says(search % "no such thing")
    assert tab.says(SHOWN) == []


def test_columns_sort_up_down_and_back(tab: Browser, file: Path) -> None:
    """By the verdict's rank; sentences go with their rows, and come back in the paper's order."""
    tab.open(file)
    head = "document.querySelectorAll('#figure-6 thead button')[4].click()"
    order = "[...document.querySelectorAll('#figure-6 .claim')].map(claim => claim.dataset.word)"
    words = tab.says(order)
    tab.says(head)
    tab.says(head)
    assert tab.says(order) == words[::-1]
    assert tab.says("document.querySelector('#figure-6 .said').checkVisibility()") is True
    assert tab.says("document.querySelector('#figure-6 .sentence').checkVisibility()") is False
    tab.says(head)
    assert tab.says(order) == words
    assert tab.says("document.querySelector('#figure-6 .said').checkVisibility()") is False


def test_the_keyboard_is_enough(tab: Browser, file: Path) -> None:
    """TAB leads past the skip link to the first word, and ENTER filters by it."""
    tab.open(file)
    for key in ("Tab", "Tab", "Enter"):
        text = {"text": "\r"} if key == "Enter" else {}
        code = {"Tab": 9, "Enter": 13}[key]
        about = {"key": key, "code": key, "windowsVirtualKeyCode": code, **text}
        tab.ask("Input.dispatchKeyEvent", type="keyDown", **about)
        tab.ask("Input.dispatchKeyEvent", type="keyUp", key=key, code=key)
    assert tab.says("document.activeElement.dataset.word") == "supported"
    assert tab.says(SHOWN) == ["figure-6-1", "figure-6-8"]
    outline = "getComputedStyle(document.activeElement).outlineStyle"
    assert tab.says(outline) == "solid"


def test_a_phone_shows_all_of_it(tab: Browser, file: Path) -> None:
    """Nothing is wider than 390 pixels, details and tables open or not."""
    tab.open(file, width=390, height=844)
    wide = "document.documentElement.scrollWidth"
    assert tab.says(wide) == 390
    tab.says("document.querySelectorAll('details').forEach(each => each.open = true)")
    assert tab.says(wide) == 390


@pytest.mark.parametrize(("width", "rows"), [(1200, 1), (1130, 1), (1000, 3), (400, 4)])
def test_words_stand_in_whole_rows(tab: Browser, file: Path, width: int, rows: int) -> None:
    """Seven of them, too, and none reaches out of its card."""
    tab.open(file, width=width)
    tops = "new Set([...document.querySelectorAll('.counts li')].map(e => e.offsetTop)).size"
    assert tab.says(tops) == rows
    cards = "[...document.querySelectorAll('.counts button')]"
    assert tab.says(f"{cards}.some(each => each.scrollWidth > each.offsetWidth)") is False


def test_dark_rooms_have_a_dark_page(tab: Browser, file: Path) -> None:
    """Whoever prefers it."""
    colour = "getComputedStyle(document.body).backgroundColor"
    tab.open(file, dark=True)
    assert tab.says(colour) == "rgb(21, 23, 26)"
    tab.open(file)
    assert tab.says(colour) == "rgb(255, 255, 255)"


def test_a_link_to_a_row_opens_it(tab: Browser, file: Path) -> None:
    """So that a row can be sent to somebody."""
    tab.open(file)
    tab.says("location.hash = '#figure-6-2'; new Promise(done => setTimeout(done, 50))")
    assert tab.says("document.querySelector('#figure-6-2 details').open") is True


def test_without_its_script_everything_is_there(tab: Browser, file: Path) -> None:
    """The search is gone, the claims are not."""
    tab.ask("Emulation.setScriptExecutionDisabled", value=True)
    try:
        tab.open(file)
    finally:
        tab.ask("Emulation.setScriptExecutionDisabled", value=False)
    assert len(tab.says(SHOWN)) == 8
    assert tab.says("document.getElementById('find').checkVisibility()") is False


def test_it_prints(tab: Browser, file: Path, tmp_path: Path) -> None:
    """As a PDF, without the search."""
    tab.open(file)
    tab.pdf(tmp_path / "page.pdf")
    assert (tmp_path / "page.pdf").read_bytes().startswith(b"%PDF")
    tab.ask("Emulation.setEmulatedMedia", media="print")
    assert tab.says("document.getElementById('find').checkVisibility()") is False
    tab.ask("Emulation.setEmulatedMedia", media="")
