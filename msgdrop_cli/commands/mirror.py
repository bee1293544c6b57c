"""`msgdrop mirror`: what the records say, copied to TensorBoard, Weights & Biases or trackio."""

import sys
import time
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from msgdrop_cli.commands.parts import console, options, words
from msgdrop_cli.errors import RecordError
from msgdrop_cli.report.mirrors import MIRRORS

if TYPE_CHECKING:
    from msgdrop_cli.report.mirroring import Mirroring
    from msgdrop_cli.stopping import Control

app = typer.Typer()

_AGAIN_S = 2.0
"""How soon a followed run is looked at again."""
_GOES_ON = ("planned", "running")


@app.command(
    epilog=options.examples(
        "mirror --to tensorboard --follow   (while runs train)",
        "mirror results/published --to wandb --into /tmp/mirror",
    )
)
def mirror(
    results: options.Folder = Path("results"),
    to: Annotated[
        str,
        typer.Option(
            metavar="|".join(MIRRORS), help="The mirror.", autocompletion=lambda: list(MIRRORS)
        ),
    ] = "tensorboard",
    into: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Its files.",
            show_default="RESULTS/mirrors/NAME",
            parser=options.path,
        ),
    ] = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Go on as runs train, until Ctrl-C.")
    ] = False,
) -> int:
    """Copy logs and evaluations to a mirror, each row once; the records stay the source.

    Names are those of Stable-Baselines3: rollout/ep_rew_mean, train/loss, eval/mean_reward. The
    mirror is never read, and training knows nothing of it.
    """
    options.check_known(to, MIRRORS, "--to")
    if into is not None:
        options.check_place(into, "--into")
    from msgdrop_cli.records.ours import refuse_links
    from msgdrop_cli.report.mirroring import Mirroring  # not for every TAB
    from msgdrop_cli.stopping import Stopped, graceful_stop

    folder = into or results / "mirrors" / to
    if into is None:
        refuse_links(results, folder)
    with graceful_stop() as control, redirect_stdout(sys.stderr):  # some of them chat
        copied = _copy(results, Mirroring(MIRRORS[to](folder), folder), control, follow)
    console.result(f"mirror  {folder}: {words.several(copied, 'new row')}")
    if control.signal is not None:
        raise Stopped(control.signal)
    return 0


def _copy(results: Path, copying: "Mirroring", control: "Control", follow: bool) -> int:
    """Copy once, or again and again until a signal comes; returns the number of rows."""
    from msgdrop_cli.records.elsewhere import runs_of

    copied = 0
    while True:
        try:
            records = runs_of(results).records
        except RecordError:
            if not follow:
                raise
            records = []  # nothing has begun yet
        copied += copying.copy(records)
        copying.close([each for each in records if each.status not in _GOES_ON])
        until = time.monotonic() + _AGAIN_S
        while follow and time.monotonic() < until and control.signal is None:
            time.sleep(0.05)
        if not follow or control.signal is not None:
            copying.close(records)
            return copied
