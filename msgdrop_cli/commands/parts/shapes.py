"""What the shapes of a plan say before anything is trained: sizes, and the names of the metrics.

Environment, learner and replay memory are built on torch's meta device, which has shapes and
takes no memory: a mistyped size is found here, not by the machine. Tables that are reckoned, not
only made, are reckoned on the processor and moved: for arithmetic on meta tensors torch loads its
compiler, which takes a second and leaves a folder in TMPDIR (tests/test_first_second.py).
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from msgdrop_cli.commands.parts.early import check_metrics
from msgdrop_cli.definition.plan import Plan
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.errors import DefinitionError

_CHECKPOINTS = 3
"""Two are kept while the next one is written."""
_REPLAYS = 3
"""Where checkpoints are put off, each one may write its whole replay memory. Both that are kept
may need a last step of a file from before, which goes only as a whole."""
_SAVED_COPIES, _HELD_COPIES = 4, 5
"""Of the parameters: online, target, and Adam's two moments; in memory the gradient, too."""
_BYTES_A_LOG_ROW = 350
_HEADROOM = 1.1
"""For manifests, headers, and the blocks of the file system."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """What one run needs."""

    parameters: int
    """Of all networks that learn, actors and critics."""
    work: float
    """Parameters times the rows that they see, an env step: multiply-adds of one dense pass."""
    kernel: str
    """What computes its updates on a processor."""
    kept: int
    """Bytes on disk that stay."""
    working: int
    """Bytes of checkpoints and replay memory on disk, gone when the run is done."""
    memory: int
    """Bytes of tensors while it trains or is evaluated."""


def run_sizes(run: PlannedRun, episodes: int) -> Sizes:
    """The sizes of a run that is evaluated in `episodes` games at once. Loads torch.

    Raises DefinitionError for sizes beyond 64 bits.
    """
    from torch import Tensor

    from msgdrop_cli.algorithms.discovery import learner_class
    from msgdrop_cli.engine.checkpoint import KEPT, SEGMENT_BYTES
    from msgdrop_cli.engine.training import Training

    def held(*owners: object) -> int:
        parts = (part for owner in owners for part in vars(owner).values())
        return sum(part.nbytes for part in parts if isinstance(part, Tensor))

    config, training = run.spec.algorithm_config, run.spec.training
    with on_no_device(f"{run.spec.environment}, {run.variant}"):
        built = Training([run.spec], "meta")
        env, learner, replay = built.env, built.learner, built.replay
        policy = learner.policy(0).values()
        kept = sum(tensor.numel() for tensor in policy)
        networks = next(iter(policy)).shape[0]
        encoder = sum(tensor.numel() for tensor in learner.encoding.tensors(0).values())
        learnt = sum(tensor.numel() for tensor in learner.tensors(0).values())
        parameters = (learnt - encoder) // _SAVED_COPIES
        cut_episodes = sum(tensor.nbytes for tensor in replay.cut_episodes(0).values())
        memory = held(env, learner, replay) + 4 * _HELD_COPIES * parameters
    seen = env.observation_size * env.observation_dtype.itemsize
    said = 4 * learner.encoding.width if learner.encoding.apart else 0
    said += env.agents - 1 if built.lost else 0  # what arrives of the others' messages
    a_step = env.agents * (seen + said + 8 + 4 * env.action_size) + 8
    whole = a_step * config.replay_capacity
    stored = _REPLAYS * whole + KEPT * min(whole, SEGMENT_BYTES)
    stored = min(stored, KEPT * a_step * training.train_env_steps)  # each step for each of the two
    state = 4 * (_SAVED_COPIES * parameters + encoder) + cut_episodes
    rows = training.train_env_steps // training.log_every_env_steps + 1
    at_once = max(training.games, episodes, 2 * config.batch_size)
    return Sizes(
        parameters=parameters,
        work=parameters * config.batch_size * env.agents / networks / config.update_every_env_steps,
        kernel=learner_class(run.spec.algorithm).kernel(config, env, "cpu"),
        kept=4 * kept + rows * _BYTES_A_LOG_ROW,
        working=int(_HEADROOM * (_CHECKPOINTS * state + stored)),
        memory=memory + 4 * at_once * learner.shown_agents.numel() * env.observation_size,
    )


def check_claims(asked: Plan, pending: Sequence[PlannedRun]) -> None:
    """Refuse (DefinitionError) to train for a claim on a metric that its environment has not.

    Loads torch.
    """
    from msgdrop_envs import registry

    known: dict[str, Mapping[str, object]] = {}
    for run in pending:
        if run.spec.environment not in known:
            with on_no_device(f"{run.spec.environment}, {run.variant}"):
                env = registry.make(run.spec.environment_config, "meta")
            known[run.spec.environment] = env.metrics
    check_metrics(asked.definition.file, asked.claims, known)


@contextmanager
def on_no_device(place: str) -> Iterator[None]:
    """Everything is built on the meta device; DefinitionError for sizes that torch cannot count."""
    import torch

    try:
        with torch.device("meta"):
            yield
    except (OverflowError, RuntimeError, TypeError, ValueError) as error:
        if not isinstance(error, OverflowError) and "verflow" not in str(error):
            raise  # what torch says of sizes, in either letter; all else is something else
        raise DefinitionError(
            f"{place}: a setting is too large: its map, networks,"
            " batches or replay memory would have more bytes than 64 bits can count"
        ) from error
