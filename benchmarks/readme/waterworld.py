"""What came out on waterworld: ten seeds, and two before them, which judge nothing."""

from collections.abc import Callable

from benchmarks.readme.judged import LABELS, counted, of_game, told_by_measure
from benchmarks.readme.studies import (
    difference,
    expect,
    number,
    paragraph,
    side_by_side,
    study,
    table,
    while_and_after,
)
from msgdrop_cli.analysis.statistics import mean

_STUDY = "waterworld-half-million"
_FIRST, _FIRST_COMMIT = "6.7, 5.9 and 7.9", "commit 3a5aa4d, published until 27 November 2026"
"""What was published of the same runs before, in the order of the labels."""
_WALLS = f"{_STUDY}-stopping-walls"
_LABELS = {each: LABELS[each] for each in ("ddpg", "maddpg", "maddpg-md-0.2")}
MILLION = "waterworld-million"
_EIGHT = "waterworld-n8"
_TOUCHES = "touches_per_500"
_LAST = 50_000
"""Env steps at the end of the training."""
_PROTOTYPE = (250_000, 300_000)
"""Env steps where a prototype's numbers are known."""


def million() -> str:
    """Each of the five arms while it learns, and after."""
    arms = ("ddpg", "vanilla-maddpg", "maddpg", "maddpg-md-0.2", "maddpg-md-0.5")
    return while_and_after(study(MILLION), {each: LABELS[each] for each in arms})


def claims() -> str:
    """The claims about eight agents, in training and after it."""
    return "\n".join(told_by_measure(study(MILLION), _EIGHT, "waterworld N = 8"))


def paper() -> str:
    """How many claims of MADDPG-MD are supported, for a cell of PAPER.md."""
    found = study(MILLION)
    during, after = (
        counted(v for v in of_game(found, _EIGHT, measure) if v.claim.better != "maddpg")
        for measure in ("learning", "evaluation")
    )
    seeds = number(len(found.arm("ddpg").done))
    return f"{seeds} seeds at N = 8: `{MILLION}`, while learning {during}, after it {after}"


def paper_vanilla() -> str:
    """The same of the network that concatenates."""
    found = study(MILLION)
    during, after = (
        found.verdict("maddpg", "vanilla-maddpg", environment=_EIGHT, measure=measure).verdict
        for measure in ("learning", "evaluation")
    )
    return f"`{MILLION}`, {during} in training, {after} after it"


def catches() -> str:
    """Catches and touches of every variant, and of policies that learn nothing."""
    found = study(_STUDY)
    rows = [
        (
            label,
            found.in_training(variant).text(),
            found.after(variant).text(),
            f"{found.after(variant, metric=_TOUCHES).mean:,.0f}",
        )
        for variant, label in _LABELS.items()
    ]
    for says, names in {
        "random play, doing nothing": ("random", "nothing"),
        "all waiting at one place": ("one place",),
        "scripted, seeing everything": ("scripted",),
    }.items():
        caught = dict.fromkeys(f"{found.reference(each):.1f}" for each in names)
        touched = [f"{found.reference(each, _TOUCHES):,.0f}" for each in names]
        rows.append((says, "", ", ".join(caught), ", ".join(touched)))
    return table(("policy", "mean of the training", "greedy, after training", "touches"), rows)


def learnt() -> str:
    """What counts as learning, and what two seeds say of an order."""
    found = study(_STUDY)
    steps = found.arm("ddpg").group.train_env_steps
    last = [
        [
            value
            for each in _LABELS
            for value in found.windows(each, steps - _LAST, steps, m).values()
        ]
        for m in ("catches_per_500", _TOUCHES)
    ]
    now = {each: found.in_training(each).mean for each in _LABELS}
    expect(min(now, key=now.__getitem__) == "maddpg-md-0.2", "that MADDPG-MD is last in training")
    before = [f"{mean([*found.windows(each, *_PROTOTYPE).values()]):.1f}" for each in _LABELS]
    parked = found.reference("one place")
    return paragraph(
        f"""Random play catches nothing, parking everybody at one place catches {parked:.1f}, so
        more than 4 catches and more than 450 touches an episode count as learning. Over the last
        {_LAST:,} env steps of their training the six runs make {min(last[0]):.1f} to
        {max(last[0]):.1f} catches and {min(last[1]):,.0f} to {max(last[1]):,.0f} touches in 500
        steps. Of an order two seeds say nothing: the same seeds, first trained when the kernel
        still added in another order, made {_FIRST} catches over the whole training (DDPG, MADDPG,
        MADDPG-MD 0.2; {_FIRST_COMMIT}), MADDPG-MD ahead of both with both seeds, and here it is
        last, with {now["maddpg-md-0.2"]:.1f} against {now["ddpg"]:.1f} and {now["maddpg"]:.1f}.
        What is rounded otherwise goes elsewhere, as another seed would. A prototype's single runs
        made 9.3, 3.1 and 12.8 at {_PROTOTYPE[1]:,} steps while training; here it is {before[0]},
        {before[1]} and {before[2]}, the means of two seeds over {_PROTOTYPE[0]:,} to
        {_PROTOTYPE[1]:,}."""
    )


def walls() -> str:
    """The same with food and poison that stop at walls: a registered reading."""
    return side_by_side({"they turn back": study(_STUDY), "they stop": study(_WALLS)}, _LABELS)


def walls_said() -> str:
    """What two seeds say of the walls, and what they do not."""
    turned, stopped = study(_STUDY), study(_WALLS)
    expect(
        all(stopped.after(each).mean < turned.after(each).mean for each in _LABELS),
        "that everybody catches less where objects stop",
    )
    ahead = " and ".join(
        f"{difference(stopped.verdict('maddpg-md-0.2', each, measure='learning')).text(1)}"
        for each in ("ddpg", "maddpg")
    )
    return paragraph(
        f"""Everybody catches less after training where food stops at walls. Who is better cannot be
        said of two seeds either way (there MADDPG-MD is ahead of DDPG and MADDPG by {ahead} over
        the training), nor whether walls change it: at a million env steps, where ten seeds are
        judged, objects turn back so far."""
    )


BLOCKS: dict[str, Callable[[], str]] = {
    "waterworld-million": million,
    "waterworld-million-claims": claims,
    "help-waterworld": claims,
    "paper-waterworld": paper,
    "paper-vanilla": paper_vanilla,
    "waterworld-catches": catches,
    "waterworld-learnt": learnt,
    "waterworld-walls": walls,
    "waterworld-walls-said": walls_said,
}
