"""Who hears whom: the contract of every topology that is found, and that only they are heard."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from msgdrop_cli.algorithms.cohort import shown_agents
from msgdrop_cli.algorithms.dcc import DCC, Config
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.messages.received import Received
from msgdrop_cli.messages.topologies import senders, topologies
from msgdrop_cli.ops.minibatch import links_heard
from tests.dcc_samples import KERNELS, OBSERVATION, integers, rand, small_config, use_kernel
from tests.runs import planned


def _of_five(**changes: str) -> DCC:
    """Five agents in a ring."""
    env: Any = SimpleNamespace(
        agents=5, observation_size=OBSERVATION, observation_dtype=torch.uint8, actions=5
    )
    learner = DCC([small_config(topology="ring", **changes)], env)
    learner.initialise(rand(1, learner.init_uniforms, seed=1))
    return learner


@pytest.mark.parametrize("agents", [1, 2, 3, 8])
@pytest.mark.parametrize("topology", topologies())
def test_everybody_hears_as_many_others(topology: str, agents: int) -> None:
    """Nobody hears itself or somebody twice, and all networks have as many message slots."""
    heard = senders(topology, agents)
    assert len(heard) == agents
    assert len({len(each) for each in heard}) == 1
    for i, each in enumerate(heard):
        assert len(set(each)) == len(each)
        assert set(each) <= set(range(agents)) - {i}


def test_all_and_ring_by_pencil() -> None:
    """Four agents: three others in increasing order (l. 149); the one before and the one after."""
    assert senders("all", 4) == [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]
    assert senders("ring", 4) == [[3, 1], [0, 2], [1, 3], [2, 0]]


def test_a_keep_mask_has_a_column_for_each_other_agent() -> None:
    """Agent 2 hears 1 and 3: columns 1 and 2 of (0, 1, 3); agent 0 hears 3 and 1: 2 and 0."""
    shown = shown_agents(senders("ring", 4), "cpu")
    assert links_heard(shown).tolist() == [[2, 0], [0, 1], [1, 2], [2, 0]]


def test_an_unknown_topology_is_refused() -> None:
    """With the nearest known one."""
    with pytest.raises(ValueError, match="none is called 'rings'; did you mean 'ring'"):
        Config(topology="rings")


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("network", ["fgh", "concat"])
def test_only_who_is_heard_matters(
    network: str, kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Agent 0 of five in a ring: what 2 and 3 see changes nothing, what 1 and 4 see does."""
    use_kernel(kernel, monkeypatch)
    learner = _of_five(network=network)
    obs = integers(3, 1, 20, 5, OBSERVATION, seed=3)
    before = learner.q_exec(obs)[:, :, 0]
    for agent, matters in ((1, True), (2, False), (3, False), (4, True)):
        changed = obs.clone()
        changed[:, :, agent] = 2 - changed[:, :, agent]
        assert torch.equal(learner.q_exec(changed)[:, :, 0], before) != matters, agent


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_broken_link_silences_its_own_sender(
    kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the link between 0 and 4 what 4 sees changes nothing for 0, and 1 is still heard."""
    use_kernel(kernel, monkeypatch)
    learner = _of_five()
    obs, keep = integers(3, 1, 20, 5, OBSERVATION, seed=3), torch.ones(1, 20, 5, 4)
    keep[:, :, 0, 3] = 0.0  # of the others of agent 0, number 4 has the last column
    before = learner.q_exec(obs, Received(keep))[:, :, 0]
    for agent, matters in ((4, False), (1, True)):
        changed = obs.clone()
        changed[:, :, agent] = 2 - changed[:, :, agent]
        assert torch.equal(learner.q_exec(changed, Received(keep))[:, :, 0], before) != matters, (
            agent
        )


def test_a_ring_is_trained_and_evaluated(tmp_path: Path) -> None:
    """From the setting to episodes: the run names its topology, and its policy is that narrow."""
    run = planned("dcc-md", topology="ring")
    [outcome] = train_cohort([run], tmp_path)
    assert outcome.status == "done"
    assert len(evaluate(outcome.path, channel=Channel("links", (0.5,)), episodes=3)) == 3
    assert '"topology": "ring"' in (outcome.path / "run.json").read_text()
    assert run.run_id != planned("dcc-md").run_id
