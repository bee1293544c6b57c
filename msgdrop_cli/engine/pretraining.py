"""What an encoder has to learn before any run begins: once, for all runs that need it.

    pretrained/<encoder>-<environment>-<id>/weights.safetensors  the encoder's and its decoder's
    pretrained/<encoder>-<environment>-<id>/pretraining.json     what they come from; the errors

Nothing of a run enters but its game, its encoder and how much that learns from: no seed, no
device. Who needs it first makes it under a lock, the others wait; where it is lost or damaged, it
is made again. A policy holds what it needs of it.
"""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor

from msgdrop_cli.algorithms.hearing import Encoding
from msgdrop_cli.algorithms.reconstruction import Reconstruction
from msgdrop_cli.definition.run_id import short_hash, spec_to_dict
from msgdrop_cli.definition.spec import RunSpec
from msgdrop_cli.engine import facts
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.tensors import LARGEST_FILE, parse_tensors, write_tensors
from msgdrop_cli.errors import RecordError
from msgdrop_cli.messages.encoders import encoder_of
from msgdrop_cli.records.files import BUSY, read_bytes, read_json, run_lock, write_json_atomic
from msgdrop_cli.records.ours import refuse_links
from msgdrop_cli.records.pretraining import Errors, Pretraining
from msgdrop_cli.records.seals import fingerprint
from msgdrop_envs import autoreset, registry
from msgdrop_envs.protocol import Environment, random_play

PRETRAINED, RECORD, WEIGHTS = "pretrained", "pretraining.json", "weights.safetensors"
"""The folder in a results folder, and the two files."""
HOW: Mapping[str, Any] = {
    "behaviour": "random",
    "games": 64,
    "passes": 10,
    "batch_size": 256,
    "learning_rate": 1e-3,
    "seed": 1,
}
"""All of it ours; a pass is as many draws as there are observations, with replacement."""
_HELD_OUT = 50_000
"""Observations, of later steps, that the error is measured on; fewer if it learns from fewer."""
_LOOK_UP_EVERY_S = 0.5


class Pretrained(NamedTuple):
    """What an encoder begins with."""

    weights: Mapping[str, Tensor]
    """As in `Encoding.tensors`; empty if it learns nothing."""
    facts: Pretraining | None
    """What a run's record says of it."""


def pretrained(
    spec: RunSpec, encoding: Encoding, root: Path, stop: Callable[[], bool] = lambda: False
) -> Pretrained | None:
    """What the encoder of this run has learnt, from the results folder `root`; made, if need be.

    None if `stop`, asked twice a second, said so. Raises RecordError: the folder cannot be used.
    """
    if not encoding.learns:
        return Pretrained({}, None)
    game = spec_to_dict(spec, cosmetic=False)["environment"]
    asked = {"encoder": encoding.name, "samples": encoding.samples, **HOW, "environment": game}
    folder = root / PRETRAINED / f"{encoding.name}-{spec.environment}-{short_hash(asked)}"
    refuse_links(root, folder)
    while not stop():
        try:
            with run_lock(folder):
                found = _read(folder, asked)
                return found or _make(folder, asked, spec.environment_config, stop)
        except RecordError as error:
            if error.exit_code != BUSY:
                raise
            time.sleep(_LOOK_UP_EVERY_S)  # another process makes it
    return None


def _read(folder: Path, asked: Mapping[str, Any]) -> Pretrained | None:
    """What stands there, if it is whole and what is asked for."""
    try:
        record = read_json(folder / RECORD)
        content = read_bytes(folder / WEIGHTS, LARGEST_FILE)
        if record["asked"] != asked or record["weights"] != fingerprint(content):
            return None
        tensors = parse_tensors(content, folder / WEIGHTS)
        errors = {name: Errors(**each) for name, each in record["errors"].items()}
    except (RecordError, AttributeError, KeyError, TypeError):
        return None
    return Pretrained(
        tensors, Pretraining(folder=folder.name, samples=asked["samples"], errors=errors)
    )


def _make(
    folder: Path, asked: Mapping[str, Any], game: Any, stop: Callable[[], bool]
) -> Pretrained | None:
    """Play, learn and write; None if `stop` said so."""
    began, env, streams = time.monotonic(), registry.make(game), Streams([asked["seed"]])
    size, held_out = asked["batch_size"], min(asked["samples"], _HELD_OUT)
    both = _play(env, streams, asked["samples"] + held_out, asked["games"])
    seen, unseen = both.split([asked["samples"], held_out])
    encoder = encoder_of(asked["encoder"])
    autoencoder = Reconstruction(encoder, env.observation_size, asked["learning_rate"])
    autoencoder.initialise(streams.uniforms("init", autoencoder.init_uniforms))
    looked_up = time.monotonic()
    for _ in range(asked["passes"] * len(seen) // size):
        autoencoder.minimise(lambda: seen[streams.integers("replay", len(seen), size)[0]])
        if time.monotonic() - looked_up >= _LOOK_UP_EVERY_S:
            looked_up = time.monotonic()
            if stop():
                return None
    record = {
        "asked": asked,
        "errors": _errors(env, autoencoder, seen, unseen),
        "wall_time_s": round(time.monotonic() - began, 3),
        "commit": facts.commit(),
        "host": facts.host(),
        "weights": write_tensors(folder / WEIGHTS, autoencoder.tensors()),
    }
    write_json_atomic(folder / RECORD, record)
    return _read(folder, asked)


def _play(env: Environment, streams: Streams, count: int, games: int) -> Tensor:
    """The first `count` observations of all agents in random play, [count, O]."""
    act, each = random_play(env).act, games * env.agents
    spread = torch.arange(games)[None] * env.time_limit // games  # so that they do not all end
    uniforms = streams.uniforms("env", games, env.reset_uniforms)
    playing = autoreset.start(env, uniforms, spread)
    seen = torch.empty(-(-count // each), each, env.observation_size, dtype=env.observation_dtype)
    for rows in seen:
        rows.copy_(playing.obs[0].flatten(0, 1))
        numbers = streams.uniforms("explore", games, env.agents, max(1, env.action_size))
        uniforms = streams.uniforms("env", games, env.step_uniforms + env.reset_uniforms)
        step, restart = uniforms.split([env.step_uniforms, env.reset_uniforms], -1)
        actions = act(playing.state, numbers)
        playing, _ = autoreset.step(env, playing, actions, step, restart)
    return seen.flatten(0, 1)[:count]


def _errors(
    env: Environment, autoencoder: Reconstruction, seen: Tensor, unseen: Tensor
) -> dict[str, dict[str, float]]:
    """Squared errors of one observation that it has not seen, channel by channel.

    `error`: of what the decoder makes of the message; `of_the_mean`: of saying the mean instead.
    """
    names = getattr(env, "observation_channels", ("all",))
    mean = seen.mean(0, dtype=torch.float32)
    each = {
        "error": autoencoder.errors(unseen),
        "of_the_mean": (unseen.float() - mean).square().mean(0),
    }
    sums = {key: found.view(len(names), -1).sum(1).tolist() for key, found in each.items()}
    return {name: {key: round(sums[key][n], 5) for key in sums} for n, name in enumerate(names)}
