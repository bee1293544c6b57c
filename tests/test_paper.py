"""PAPER.md names files and tests that exist; every line of the paper that is cited is one we know.

The paper's source is not in this repository. `LINES` was read off it once; who cites another line
looks it up there and adds it.
"""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "PAPER.md").read_text()
NAMED = sorted(set(re.findall(r"`(test_\w+)`", PAGE)))
FILES = sorted(set(re.findall(r"`((?:msgdrop_cli|envs|ablations|tests)/[\w./-]+)`", PAGE)))
CITING = sorted(
    path
    for folder in ("msgdrop_cli", "envs", "ablations", "benchmarks", "tests", "PAPER.md")
    for path in [ROOT / folder, *(ROOT / folder).rglob("*")]
    if path.suffix in {".py", ".toml", ".md", ".c", ".h"} and "corpus" not in path.parts
)
SPAN = r"\d+(?:-\d+)?"
CITATION = re.compile(rf"\bl\.\s+({SPAN}(?:(?:,|\s+and)\s+{SPAN}\b)*)")
LAST = 822
"""Lines of `paper.tex`."""
LINES = {
    72: "we simply approximate $Q^i(s,a^i)$ with $Q^i(o^i,a^i)",
    92: "centralized critic uses additional information about the policies of other agents",
    149: r"m^i = (m^{i,1},\cdots,m^{i,i-1},m^{i,i+1},\cdots,m^{i,N})",
    150: "Double Deep Q-Network (DDQN)",
    156: r"L(\theta^i)=\mathbb{E}",
    172: "at the input of the Q-network",
    173: "dropped out simultaneously in a blockwise fashion with probability $p$",
    179: "represents the dropped-out input units",
    187: r"Initialize $\theta^1,\cdots,\theta^N$",
    199: "Receive messages",
    201: r"With probability $\epsilon$ select a random action",
    203: "otherwise select the action",
    207: r"Execute $\overrightarrow{a}$",
    213: "Store transition",
    215: r"from $\mathcal{D}^i$",
    217: "Generate a binary mask",
    219: "minimizing the loss function",
    223: "Update the target network",
    233: "Q-learning process for DCC with message-dropout",
    234: "performed independently for each",
    241: r"$b_{j,k}$ $\sim$ Bernoulli($p$)",
    244: r"(y^i_j-Q^i(o_j^i,\tilde{m_j}^{-i},a^i_j;\theta^i))^2",
    247: r"\mbox{argmax}_{a^i}Q^i_{exec}",
    248: "outgoing weights of $m^i$ are multiplied by $1-p$",
    251: r"\mbox{argmax}_{a^i} Q_{exec}^i",
    258: "dropout masks change at each training time",
    262: "approximate averaging over the ensemble",
    263: "special cases of the dropout rate $p=0$ and $p=1$",
    273: r"$(\tilde{\mathbf{x}}',\overrightarrow{a'};\theta^{i-}_Q)|_{{a'}^j={\mu'}^j({o'}^j)}$",
    271: r"\mathcal{L}(\theta^i_Q) = \mathbb{E}",
    274: "the same binary mask is used",
    277: r"\nabla_{a^i} Q_{\mu}^i (\tilde{\mathbf{x}}, \overrightarrow{a}))|_{a^i = \mu^i(o^i)}",
    279: "We refer to MADDPG with message-dropout applied as MADDPG-MD",
    289: "each agent's message is its observation itself",
    290: r"\mathcal{M}_i^j = \Omega_j",
    365: "all the evaders are at the center",
    366: "initially located at a random position",
    367: "surrounded by  pursuers or map boundaries",
    368: "receive $-R_1^-$ reward for each time step",
    369: "all the evaders are captured or  $T$ time steps elapse",
    370: "map boundary, evader(s), or other pursuer(s)",
    371: "up to $D$ distances in four directions",
    372: r"$3\times (2D+1)\times (2D+1)$ observation window",
    373: "we set $R^+=5$, $R_1^-=0.05$, $R_2^-=0.5$, $T=500$, $M=2$ and $D=3$",
    377: r"introduced in \cite{mordatch2017emergence}",
    378: "occupy all of the landmarks",
    379: "only if the distance is less than $D$",
    380: "minimun of the distances",
    381: "we set $R_2^{-}=2$",
    386: "$M$ food targets, $L$ poison targets, and one obstacle",
    388: "at least $K$ agents need to cooperate",
    389: "25 range-limited sensors",
    390: "to offer the distances and velocities of other agents, food targets, and poison",
    391: "$R_1^{+}$ when they capture a food target",
    392: "if the agent touches a food target",
    393: "square norm of the action",
    394: "$R_1^{+}=10$, $R_2^{+}=0.01$, $R_1^{-}=0.1$",
    404: "h(f(o^i,a^i),g(m^i))",
    407: "concatenation of $o^{-i}$ and $a^{-i}$",
    417: "$p=[0,0.1,0.2,0.3,0.4,0.5,1.0]$",
    418: "$p=1$ corresponds to FDC",
    419: "averaged over $1000$ episodes and 7 random seeds",
    420: "best dropout rate is around $[0.2,0.3]$",
    421: "significantly outperforms both simple DCC and FDC",
    422: "simple DCC has even worse performance than FDC",
    428: "dropout rate $0.2$ and $0.5$",
    429: "the sum of all agents' rewards averaged over $7$ random seeds",
    430: "outperforms simple DCC and FDC",
    436: "$0.2$ and $0.5$",
    438: "the number of food target catches averaged over random seeds",
    435: "(independent) DDPG, vanilla MADDPG, MADDPG, and MADDPG-MD",
    439: "MADDPG-MD outperforms both",
    454: "especially for large $N$ as the dropout rate increases",
    455: "number of evader catches in $500$ time steps",
    456: "learning speed increases as the dropout rate increases",
    457: "where the number of agents is $N=8$",
    458: "gain in both the learning speed and the steady-state performance",
    459: "corresponding performance in the execution phase after the training",
    460: "drop rate of 0.2 to 0.5 yields similar performance",
    464: "in an element-wise manner",
    465: "better performance than the standard element-wise dropout",
    489: "applies message-dropout to each agent's own observation",
    490: "increases the training time",
    491: "slower training than simple DCC",
    492: "full standard elementwise dropout fails to train",
    508: "Concat-MD-p",
    514: "learning failed with",
    515: "concatenation of each agent's own observation and the received messages",
    525: "we use a zero vector instead of the message",
    527: "two considered cases in pursuit",
    528: "outperforms both simple DCC and FDC when the communication link is broken",
    529: "FDC is better in this case",
    561: "communication between limited pairs of agents",
    745: "$f$ is a two multi-layer perceptron (MLP) with 64 hidden units",
    746: "96-dimensional output",
    747: "as the output of $h$",
    748: "two MLP with 32 hidden units",
    749: "ReLU expect the final linear layer",
    750: "64, 48, 32, and 5 units",
    751: "128-dimensional output",
    753: r"$\epsilon$ annealed from 1 to 0.02 over initial $2\times 10^6$ time steps",
    759: r"$4\times N+2$",
    760: "64, 64, 32, 5 units",
    762: r"over $4\times 10^5$ time steps",
    766: "message input units from other agents",
    768: "decentralized actor in MADDPG is two MLP with 64 hidden units",
    770: "$f$ is 2 MLP with 200 hidden units and produces a 100-dimensional output",
    772: "all agents share the parameter of critic and actors",
    786: "We compress each agent's observation using the traditional autoencoder",
    787: "degrades the steady-state performance",
    790: "147-dimensional observation is compressed to 32-dimensional message",
}
"""Key words of each line that may be cited by itself."""


def cited(text: str) -> list[tuple[int, int]]:
    """First and last line of each citation, `l. 173, 235-241` being two."""
    spans = [part for found in CITATION.findall(text) for part in re.findall(SPAN, found)]
    return [(int(span.split("-")[0]), int(span.split("-")[-1])) for span in spans]


def unknown(text: str) -> list[tuple[int, int]]:
    """What is cited and is no line of the paper, or a stretch of it without one that we know."""
    return [
        (first, last)
        for first, last in cited(text)
        if not (first in LINES if first == last else 1 <= first < last <= LAST)
        or not any(first <= line <= last for line in LINES)
    ]


@pytest.mark.parametrize("file", FILES)
def test_every_file_named_exists(file: str) -> None:
    """A row that points nowhere is worse than none."""
    assert (ROOT / file).is_file()


@pytest.mark.parametrize("name", NAMED)
def test_every_test_named_exists(name: str) -> None:
    """Each statement is held by a test that is really there."""
    sources = "".join(path.read_text() for path in (ROOT / "tests").glob("test_*.py"))
    assert f"def {name}(" in sources


@pytest.mark.parametrize("path", CITING, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_line_cited_is_known(path: Path) -> None:
    """A citation leads to the words it is about; invented sources in tests are `l. 1` and `2`."""
    invented = {(1, 1), (2, 2)} if path.parent.name == "tests" else set()
    assert set(unknown(path.read_text())) - invented == set()


def test_citations_are_read_as_people_write_them() -> None:
    """Single lines, stretches, and lists of both; numbers after other words are none."""
    assert cited("(l. 173), paper l. 201-203, 251; l. 414-423 and 447-460, figures 3 and 4") == [
        *((173, 173), (201, 203), (251, 251), (414, 423), (447, 460))
    ]
    # Blank, reversed, beyond the end, and a stretch of nothing that we know.
    wrong = "".join(f"l. {span} " for span in ("752", "203-201", "800-823", "1-9"))
    assert unknown(wrong) == [(752, 752), (203, 201), (800, 823), (1, 9)]


def test_the_page_names_something() -> None:
    """The patterns above still find what they look for."""
    assert len(NAMED) > 30
    assert len(FILES) > 10
    assert len(cited(PAGE)) > 30
    assert len(CITING) > 100
