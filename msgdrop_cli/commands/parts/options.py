"""The options that several commands share, and the checks that need nothing heavy."""

import os
import shlex
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from msgdrop_cli.commands.parts import completion
from msgdrop_cli.definition.channel import WORDS
from msgdrop_cli.definition.load import list_askable
from msgdrop_cli.definition.profiles import profile_called
from msgdrop_cli.definition.seeds import parse_seeds
from msgdrop_cli.definition.spec import MOST_EPISODES, Definition, is_factory
from msgdrop_cli.definition.strict import Where, one_line
from msgdrop_cli.definition.typed_numbers import whole_number
from msgdrop_cli.errors import DefinitionError, RecordError, nearest
from msgdrop_cli.records.files import CANNOT_CREATE

_DEVICES = ("cpu", "cuda")
_MOST_WORKERS = 256
_AUTO = "auto"
"""Instead of seeds: those of the next registered look."""
WORKERS = 2
"""Processes that train and evaluate if nobody says how many."""
_PROFILE = "quick"
"""The profile that is meant if none is named, where there are several."""


def path(text: str | Path) -> Path:
    """A path as people type it: shells leave the `~` of `--results=~/x` to us.

    Nothing at all is refused: it is what an unset variable leaves, and would be the folder we are
    in.
    """
    if not str(text):
        raise typer.BadParameter("expected a path, not ''")
    try:
        return Path(text).expanduser()
    except RuntimeError as error:
        raise typer.BadParameter(f"{str(text)!r}: whose home is not known") from error


def question(text: str) -> str:
    """A question's name, left as it is, or the path of its file."""
    return str(path(text)) if text.startswith("~") else text


def whole(text: str | int) -> int:
    """A whole number as people type it: 1000, 1_000, 1e3."""
    try:
        return whole_number(str(text))
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


SCALE = "Scale: quick (minutes), million, paper (days)."
Profile = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help=SCALE,
        show_default="quick, or the only one",
        autocompletion=completion.profiles,
    ),
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="A.B=V",
        help="Override a setting of all variants, e.g. algorithm.gamma=0.9, or of one, e.g. "
        "variants.md-0.2.algorithm.rate=0.3.",
        autocompletion=completion.settings,
    ),
]
Reading = Annotated[
    list[str] | None,
    typer.Option(
        "--reading",
        metavar="NAME",
        help="Read the paper otherwise, e.g. capture-once.",
        autocompletion=completion.readings,
    ),
]
Seeds = Annotated[
    str | None, typer.Option(metavar="N|A,B,..", help="A number of seeds (3) or a list (1,5,9).")
]
SeedsOrAuto = Annotated[
    str | None,
    typer.Option(
        "--seeds",
        metavar="N|A,B,..|auto",
        help="A number of seeds (3), a list (1,5,9), or auto: as many as the next registered look"
        " takes, of the variants whose claims are open.",
    ),
]
Seed = Annotated[int | None, typer.Option(metavar="N", help="Only this seed.", parser=whole)]
Workers = Annotated[
    int, typer.Option(metavar="N", help="Processes that work at the same time.", parser=whole)
]
Device = Annotated[
    str,
    typer.Option(
        metavar="cpu|cuda", help="Where tensors live.", autocompletion=lambda: list(_DEVICES)
    ),
]
Question = Annotated[
    str,
    typer.Argument(
        metavar="NAME|FILE.toml",
        help="The question.",
        parser=question,
        autocompletion=list_askable,
    ),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="dask://HOST:PORT|local:N",
        help="Train on the workers of a Dask cluster, with a shared results folder or without.",
    ),
]
ClusterTls = Annotated[
    str | None,
    typer.Option(metavar="CA,CERT,KEY", help="Files that the cluster wants to see."),
]
Results = Annotated[
    Path, typer.Option("--results", metavar="DIR", help="The results folder.", parser=path)
]
Folder = Annotated[
    Path,
    typer.Argument(metavar="[RESULTS]", help="A results folder or a part of it.", parser=path),
]
Episodes = Annotated[
    int, typer.Option(metavar="N", help="Episodes of each policy and channel.", parser=whole)
]
BrokenLinks = Annotated[
    str,
    typer.Option(
        metavar="SHARE",
        help="How many links are broken: none, half, all, 0.3 or 30%.",
        autocompletion=lambda: list(WORDS),
    ),
]
Channels = Annotated[
    list[str] | None,
    typer.Option(
        "--channel",
        metavar="KIND:SETTINGS",
        help="What else messages go through: loss:0.2, bursts:0.2,4, delay:2, ...; what receivers"
        " do after +: loss:0.2+hold:5.",
        autocompletion=completion.channels,
    ),
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Show the plan and stop there.")]
Json = Annotated[bool, typer.Option("--json", help="Results as JSON on stdout.")]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainOptions:
    """What `ablate` and `train` have in common, checked."""

    profile: str
    overrides: tuple[str, ...]
    readings: tuple[str, ...]
    seeds: tuple[int, ...] | None
    to_next_look: bool
    """Seeds are `auto`."""
    workers: int
    device: str
    results: Path
    dry_run: bool
    json: bool
    cluster: str | None = None
    cluster_tls: tuple[Path, ...] = ()


def examples(*lines: str) -> str:
    """What stands at the end of a command's help; each line begins with the command's name."""
    return "\n".join(("\b", "Examples:", *(f"  msgdrop {line}" for line in lines)))


def train_options(
    *,
    profile: str,
    overrides: list[str] | None,
    seed: int | None,
    seeds: str | None,
    workers: int,
    device: str,
    results: Path,
    dry_run: bool,
    json: bool,
    readings: list[str] | None = None,
    cluster: str | None = None,
    cluster_tls: str | None = None,
) -> TrainOptions:
    """The options as given, checked; DefinitionError where a value cannot be meant."""
    from msgdrop_cli.cluster.connection import (
        check_cluster,
        check_tls,
    )  # the TAB key needs none of it

    check_workers(workers)
    check_device_name(device)
    check_place(results, "--results")
    auto = seeds == _AUTO and seed is None
    return TrainOptions(
        profile=profile,
        overrides=tuple(overrides or ()),
        readings=tuple(readings or ()),
        seeds=chosen_seeds(seed, None if auto else seeds),
        to_next_look=auto,
        workers=workers,
        device=device,
        results=results,
        dry_run=dry_run,
        json=json,
        cluster=check_cluster(cluster) if cluster else None,
        cluster_tls=check_tls(cluster_tls) if cluster_tls else (),
    )


def chosen_seeds(seed: int | None, seeds: str | None) -> tuple[int, ...] | None:
    """The seeds that `--seed` and `--seeds` ask for, None without either."""
    if seed is not None and seeds is not None:
        raise DefinitionError("--seed is one seed, --seeds are several: give one of them")
    if seed is not None:
        return parse_seeds(f"{seed},", "--seed")
    return None if seeds is None else parse_seeds(seeds)


def chosen_profile(definition: Definition, profile: str | None) -> str:
    """The profile that is meant: the one named, the only one there is, or quick."""
    if profile is not None:
        profile_called(definition, profile)  # it says at once that there is none
        return profile
    known = list(definition.profiles)
    if len(known) > 1 and _PROFILE not in known:
        where = Where(definition.file).at("profiles")
        raise where.error(f"which one is meant? --profile {' or '.join(known)}")
    return known[0] if len(known) == 1 else _PROFILE


def check_place(named: Path, option: str, *, is_file: bool = False) -> None:
    """Refuse (RecordError, 73) to write to what lies in a folder that is not there.

    What is named is made, a file or a folder; what it lies in is not, for nobody has named that,
    and a mistyped path would become folders that nobody looks for.
    """
    folder = named.parent
    if not is_file and os.path.lexists(named) and named.is_file():
        raise RecordError(one_line(f"{option}: {named}: is a file; name a folder"), CANNOT_CREATE)
    if not os.path.lexists(named) and not os.path.lexists(folder):
        make = shlex.join(["mkdir", "-p", str(folder)])
        problem = f"{option}: {named}: cannot be created: {folder} is not there ({make})"
        raise RecordError(one_line(problem), CANNOT_CREATE)


def check_workers(workers: int) -> None:
    """Refuse a number of processes that cannot be meant."""
    if not 1 <= workers <= _MOST_WORKERS:
        raise DefinitionError(f"--workers: expected 1 to {_MOST_WORKERS}, not {workers}")


def check_episodes(episodes: int) -> None:
    """Refuse a number of evaluation episodes that cannot be meant."""
    if not 1 <= episodes <= MOST_EPISODES:
        raise DefinitionError(f"--episodes: expected 1 to {MOST_EPISODES:,}, not {episodes}")


def check_device_name(device: str) -> None:
    """Refuse a device that has no meaning here."""
    check_known(device, _DEVICES, "--device")


def check_device_plays(games: Iterable[str], device: str) -> None:
    """Refuse games of other people on anything but the CPU, where their code runs."""
    if device != "cpu" and any(map(is_factory, games)):
        raise DefinitionError("--device: games of other people are played with --device cpu")


def check_known(chosen: str, known: Collection[str], option: str) -> None:
    """Refuse what an option has no such word for."""
    if chosen not in known:
        raise DefinitionError(
            f"{option}: {chosen[:40]!r} is unknown; {nearest(chosen[:40], known)}"
        )


def check_device(device: str) -> None:
    """Refuse cuda where torch finds none. Loads torch."""
    import torch

    if device == "cuda" and not torch.cuda.is_available():
        raise DefinitionError("--device: cuda is not available on this machine; use cpu")
