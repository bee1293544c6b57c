"""The page of `msgdrop replay` in a real browser: it says nothing wrong and asks for nothing."""

import json
import re
import shutil
import subprocess
from typing import Any

import pytest

from msgdrop_cli.engine.episode import Episode, Frame, Link
from msgdrop_cli.report.replay import page
from msgdrop_envs.drawing import BLUE, ORANGE, Disc

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not BROWSER, reason="there is no Chromium here to open the page with"),
]
USER = """<pre id="found"></pre><script>
const said = () => ["said", "who"].map(each => $(each).textContent);
const found = {begun: said()};
$("slider").value = 1;
$("slider").dispatchEvent(new Event("input"));
found.slid = said();
const box = canvas.getBoundingClientRect();
const at = {clientX: box.left + 0.25 * box.width, clientY: box.top + 0.25 * box.height};
canvas.dispatchEvent(new MouseEvent("click", at));
found.clicked = said();
document.dispatchEvent(new KeyboardEvent("keydown", {key: "ArrowLeft"}));
found.stepped = said();
found.drawn = [...pen.getImageData(0.25 * side, 0.25 * side - 50, 1, 1).data];
found.kinds = $("kinds").textContent;
found.asked = performance.getEntriesByType("resource").length;
fetch("https://example.org/").catch(() => { found.refused = true; }).finally(() => {
  $("found").textContent = JSON.stringify(found);
});
</script>"""
"""Somebody who pulls the slider, clicks an agent, presses a key and writes down what is said."""


def frame(step: int) -> Frame:
    """Three agents, of whom the first can talk to the second, and in step 1 not to the third."""
    places = ((0.25, 0.25), (0.75, 0.25), (0.5, 0.75))
    agents = [Disc(x, y, 0.05, BLUE, str(n), "agent") for n, (x, y) in enumerate(places)]
    links = [Link(0, 1, True), Link(0, 2, step != 1), Link(1, 2, True)]
    evader = Disc(0.5, 0.5, 0.02, ORANGE, "", "evader")
    return Frame([*agents, evader], links, 2 * (step == 1), 6, (("catches", float(step)),))


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, str]:
    """What the user has found on the page, and what the browser complained about."""
    folder = tmp_path_factory.mktemp("browser")
    episode = Episode("<b>a run</b>", ("a0", "a1", "</script>"), [frame(0), frame(1)], "catches 1")
    content = page(episode).decode()
    (folder / "page.html").write_text(content.replace("</html>", f"{USER}</html>"))
    done = subprocess.run(
        [
            *(BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"),
            *(f"--user-data-dir={folder / 'profile'}", "--virtual-time-budget=3000", "--dump-dom"),
            (folder / "page.html").as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    [found] = re.findall(r'<pre id="found">(.*?)</pre>', done.stdout)
    complaints = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return json.loads(found.replace("&lt;", "<").replace("&gt;", ">")), "\n".join(complaints)


def test_the_slider_shows_each_step(opened: tuple[Any, str]) -> None:
    """What was lost in it and before, and the score so far."""
    found, _ = opened
    assert found["begun"] == ["step 1 of 2; messages lost: 0 of 6, in all 0 of 6; catches 0", ""]
    assert found["slid"][0] == "step 2 of 2; messages lost: 2 of 6, in all 2 of 12; catches 1"


def test_an_agent_is_inspected_by_a_click(opened: tuple[Any, str]) -> None:
    """Its links, and with whom it lost a message; a key steps."""
    found, _ = opened
    lost = "a0: 1 of 2 links broken; lost a message between it and </script>"
    assert found["clicked"][1] == lost
    assert found["stepped"][0] == found["begun"][0]
    assert found["stepped"][1] == "a0: 0 of 2 links broken"


def test_things_are_drawn_and_named(opened: tuple[Any, str]) -> None:
    """An agent in its colour, and what the colours mean."""
    found, _ = opened
    assert found["drawn"] == [*BLUE, 255]
    assert "evader" in found["kinds"]


def test_it_asks_for_nothing(opened: tuple[Any, str]) -> None:
    """Nothing was loaded, and its own policy would not let it."""
    found, complaints = opened
    assert found["asked"] == 0
    assert found["refused"] is True
    assert "Content Security Policy" in complaints  # the one request that the user tried


def test_the_console_stays_empty(opened: tuple[Any, str]) -> None:
    """But for what that request is told."""
    _, complaints = opened
    ours = [line for line in complaints.splitlines() if "example.org" not in line]
    assert ours == []
