"""How often the rule of verdicts is wrong, and how soon right: simulated studies, judged by it.

    python -m benchmarks.verdict_level --studies 100000
    python -m benchmarks.verdict_level --studies 100000 --anytime
    python -m benchmarks.verdict_level --studies 100000 --unlike

In the first, each study has four arms and the four claims of two of them against the other two, as
a question has: arms of one seed share its luck, claims share arms. The second is of the e-process
beside the verdicts: one claim, looked at after every seed by somebody who stops when it pleases.
The third is of what the rule assumes: one claim whose arms have equal means and noise of other
shapes, at the second shipped look. Nothing here is a model of the rule; the studies go through the
code of the program, look by look, until nothing is open.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

from msgdrop_cli.analysis.e_process import e_process
from msgdrop_cli.analysis.sequential import decided, flips_of
from msgdrop_cli.analysis.sign_flips import Flipped
from msgdrop_cli.definition.spec import Registration

RULE = Registration(looks=(6, 8, 10, 12), alpha_spent=(0.015, 0.025, 0.035, 0.05))
"""Four looks as the shipped questions have, of fewer seeds: 10^5 times 2^19 patterns take a day."""
SHIPPED = Registration(looks=(6, 10, 14, 20), alpha_spent=(0.015, 0.025, 0.035, 0.05))
SEED = 1
MOST_SEEDS = 60
"""Of a study that is looked at after every seed."""
CLAIMS = ((0, 2), (0, 3), (1, 2), (1, 3))
"""Better and worse of four arms."""

Noise = Callable[[np.random.Generator, tuple[int, int]], Any]
NOISE: dict[str, tuple[Noise, float]] = {
    "normal": (lambda rng, shape: rng.normal(size=shape), 1.0),
    "heavy": (lambda rng, shape: rng.standard_t(3, size=shape), 3.0**0.5),
    "skewed": (lambda rng, shape: rng.exponential(size=shape), 1.0),
}
"""What a seed does to an arm, and its standard deviation."""
SEEN = Registration(looks=(6, 10), alpha_spent=(0.015, 0.025), seen=6)
"""The first two looks of the shipped questions."""
UNLIKE: dict[str, Noise] = {
    "normal, both": lambda rng, shape: rng.normal(size=shape) - rng.normal(size=shape),
    "normal, one thrice as wide": lambda rng, n: 3.0 * rng.normal(size=n) - rng.normal(size=n),
    "skewed against normal": lambda rng, n: rng.exponential(size=n) - 1.0 - rng.normal(size=n),
    "skewed against none": lambda rng, shape: rng.exponential(size=shape) - 1.0,
    "one seed in ten collapses": lambda rng, shape: 1.0 - 10.0 * (rng.random(shape) < 0.1),
}
"""Differences of two arms with equal means."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What became of the studies of one kind."""

    wrong: float
    """Share of them that decided a claim of which nothing is true."""
    right: tuple[float, ...]
    """Share of true claims that were supported by each look."""
    seeds: float
    """Seeds at which a study ended, on average: nothing open, or no look left."""


def simulate(
    rule: Registration, studies: int, *, better: int, effect: float, noise: str = "normal"
) -> Found:
    """Judge studies in which the first `better` of the two better arms are ahead.

    effect: in standard deviations of a seed's difference.
    """
    wrong, ended, right = 0, 0, np.zeros(len(rule.looks))
    for study in drawn(rule.looks[-1], studies, better=better, effect=effect, noise=noise):
        when = decided(flips(study, rule), rule)
        true = [look for (arm, _), look in zip(CLAIMS, when, strict=True) if arm < better]
        false = [look for (arm, _), look in zip(CLAIMS, when, strict=True) if arm >= better]
        wrong += any(look is not None for look in false)
        for look in true:
            if look is not None:
                right[look:] += 1.0 / len(true)
        ended += rule.looks[max(len(rule.looks) - 1 if look is None else look for look in when)]
    return Found(wrong=wrong / studies, right=tuple(right / studies), seeds=ended / studies)


def flips(differences: Sequence[Sequence[float]], rule: Registration) -> list[Flipped]:
    """Those of studies without a lost run; differences: [claims][seeds]."""
    return flips_of([[each[:seeds] for each in differences] for seeds in rule.looks], rule)


def drawn(
    seeds: int, studies: int, *, better: int, effect: float, noise: str
) -> Iterator[list[list[float]]]:
    """The differences of every study: [claims][seeds]."""
    rng = np.random.default_rng(SEED)
    draw, deviation = NOISE[noise]
    shift = np.zeros((4, 1))
    shift[:better] = effect * deviation * 2.0**0.5
    for _ in range(studies):
        arms = draw(rng, (4, seeds)) + shift  # what a seed does to all arms alike cancels
        yield [(arms[first] - arms[second]).tolist() for first, second in CLAIMS]


def stopped(studies: int, *, effect: float, noise: str = "normal") -> list[int]:
    """The seed at which the e-process of each study's first claim first reaches 20; 0 for never."""
    found = []
    for [first, *_] in drawn(MOST_SEEDS, studies, better=1, effect=effect, noise=noise):
        reached = (seed for seed, e in enumerate(e_process(first, 2), start=1) if e >= 20.0)
        found.append(next(reached, 0))
    return found


def unlike(studies: int, draw: Noise) -> float:
    """The share of studies that decide a claim about two arms with equal means."""
    differences = draw(np.random.default_rng(SEED), (studies, SEEN.looks[-1])).tolist()
    return sum(decided(flips([each], SEEN), SEEN) != [None] for each in differences) / studies


def main() -> None:
    """Print a row of Markdown for each kind of study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=100_000, help="a tenth for power alone")
    parser.add_argument("--shipped", action="store_true", help="the four looks of the questions")
    parser.add_argument("--anytime", action="store_true", help="the e-process, at any stop")
    parser.add_argument("--unlike", action="store_true", help="equal means, other shapes")
    options = parser.parse_args()
    if options.unlike:
        _unlike(options.studies)
        return
    if options.anytime:
        _anytime(options.studies)
        return
    rule = SHIPPED if options.shipped else RULE
    looks = " | ".join(f"by {look} seeds" for look in rule.looks)
    print(f"| true claims | d | noise | studies | wrong | {looks} | ended at |")
    print("|---" * (6 + len(rule.looks)) + "|")
    kinds = [(0, 0.0, name) for name in NOISE]
    kinds += [(1, 2.0, name) for name in NOISE]
    kinds += [(1, 1.0, "normal"), (1, 1.5, "normal")]
    kinds += [(2, effect, "normal") for effect in (1.0, 1.5, 2.0)]
    for rank, (better, effect, noise) in enumerate(kinds):
        studies = options.studies // (1 if rank < 2 * len(NOISE) else 10)
        found = simulate(rule, studies, better=better, effect=effect, noise=noise)
        print(_row(found, studies, better=better, effect=effect, noise=noise), flush=True)


def _anytime(studies: int) -> None:
    print(
        f"| d | noise | studies | by {MOST_SEEDS} seeds | by 6 | by 10 | by 14 | by 20 | median |"
    )
    print("|---" * 9 + "|")
    kinds = [(0.0, name) for name in NOISE] + [(effect, "normal") for effect in (1.0, 1.5, 2.0)]
    for effect, noise in kinds:
        seeds = stopped(studies if not effect else studies // 10, effect=effect, noise=noise)
        ever = sum(map(bool, seeds)) / len(seeds)
        error = (ever * (1.0 - ever) / len(seeds)) ** 0.5
        shares = [sum(0 < seed <= by for seed in seeds) / len(seeds) for by in (6, 10, 14, 20)]
        cells = [f"{effect:g}", noise, f"{len(seeds):,}", f"{ever:.2%} +- {error:.2%}"]
        cells += [f"{share:.1%}" for share in shares]
        cells.append(f"{median(filter(None, seeds)):g}" if ever > 0.5 else "")
        print("| " + " | ".join(cells) + " |", flush=True)


def _unlike(studies: int) -> None:
    print("| noise of the two arms | studies | decided |")
    print("|---" * 3 + "|")
    for name, draw in UNLIKE.items():
        wrong = unlike(studies, draw)
        error = (wrong * (1.0 - wrong) / studies) ** 0.5
        print(f"| {name} | {studies:,} | {wrong:.2%} +- {error:.2%} |", flush=True)


def _row(found: Found, studies: int, *, better: int, effect: float, noise: str) -> str:
    error = (found.wrong * (1.0 - found.wrong) / studies) ** 0.5
    cells = [
        f"{2 * better} of {len(CLAIMS)}",
        f"{effect:g}" if better else "",
        noise,
        f"{studies:,}",
        f"{found.wrong:.2%} +- {error:.2%}" if better < 2 else "",
        *(f"{share:.1%}" if better else "" for share in found.right),
        f"{found.seeds:.1f}",
    ]
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
