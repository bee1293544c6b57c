"""The options that several commands share, and the checks that need nothing heavy."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.definition.plan import parse_seeds
from msgdrop_cli.errors import DefinitionError, nearest

_DEVICES = ("cpu", "cuda")
_MOST_WORKERS = 256

Profile = Annotated[
    str, typer.Option(metavar="NAME", help="Scale: quick (minutes), million, paper (days).")
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="A.B=V",
        help="Override a setting of all variants, e.g. algorithm.gamma=0.9, or of one, e.g. "
        "variants.md-0.2.algorithm.rate=0.3.",
    ),
]
Seeds = Annotated[
    str | None, typer.Option(metavar="N|A,B,..", help="A number of seeds (3) or a list (1,5,9).")
]
Workers = Annotated[int, typer.Option(metavar="N", help="Processes that work at the same time.")]
Device = Annotated[str, typer.Option(metavar="cpu|cuda", help="Where tensors live.")]
Results = Annotated[Path, typer.Option("--results", metavar="DIR", help="The results folder.")]
Folder = Annotated[
    Path, typer.Argument(metavar="[RESULTS]", help="A results folder or a part of it.")
]
Episodes = Annotated[int, typer.Option(metavar="N", help="Episodes of each policy and channel.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Show the plan and stop there.")]
Json = Annotated[bool, typer.Option("--json", help="Results as JSON on stdout.")]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainOptions:
    """What `ablate` and `train` have in common, checked."""

    profile: str
    overrides: tuple[str, ...]
    seeds: tuple[int, ...] | None
    workers: int
    device: str
    results: Path
    dry_run: bool
    json: bool


def train_options(
    *,
    profile: str,
    overrides: list[str] | None,
    seeds: str | None,
    workers: int,
    device: str,
    results: Path,
    dry_run: bool,
    json: bool,
) -> TrainOptions:
    """The options as given, checked; DefinitionError where a value cannot be meant."""
    check_workers(workers)
    check_device_name(device)
    return TrainOptions(
        profile=profile,
        overrides=tuple(overrides or ()),
        seeds=None if seeds is None else parse_seeds(seeds),
        workers=workers,
        device=device,
        results=results,
        dry_run=dry_run,
        json=json,
    )


def check_workers(workers: int) -> None:
    """Refuse a number of processes that cannot be meant."""
    if not 1 <= workers <= _MOST_WORKERS:
        raise DefinitionError(f"--workers: expected 1 to {_MOST_WORKERS}, not {workers}")


def check_episodes(episodes: int) -> None:
    """Refuse a number of evaluation episodes that cannot be meant."""
    if not 1 <= episodes <= 1_000_000:
        raise DefinitionError(f"--episodes: expected 1 to 1,000,000, not {episodes}")


def check_device_name(device: str) -> None:
    """Refuse a device that has no meaning here."""
    if device not in _DEVICES:
        raise DefinitionError(
            f"--device: {device[:40]!r} is unknown; {nearest(device[:40], _DEVICES)}"
        )


def check_device(device: str) -> None:
    """Refuse cuda where torch finds none. Loads torch."""
    import torch

    if device == "cuda" and not torch.cuda.is_available():
        raise DefinitionError("--device: cuda is not available on this machine; use cpu")
