"""What `explain` knows: everything with a name, in the words that stand where it is defined."""

import ast
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import suppress
from itertools import chain
from typing import NamedTuple

from msgdrop_cli.commands.parts import sources, vocabulary
from msgdrop_cli.commands.parts.sources import Module, notation
from msgdrop_cli.commands.parts.topics.asked import asked_topics
from msgdrop_cli.commands.parts.topics.question_keys import Key, question_file, question_keys
from msgdrop_cli.commands.parts.topics.topic import Fact, Topic, sentence
from msgdrop_cli.commands.parts.topics.words import command_topics, word_topics
from msgdrop_cli.commands.parts.vocabulary import Section
from msgdrop_cli.definition.channel import LINKS, NAMED, WORDS, Channel
from msgdrop_cli.definition.pages import METRICS, page, rows
from msgdrop_cli.definition.shipped import PAPER, shipped_file

_CHANNELS = "msgdrop_cli.channels"
_METRIC = ("count", "per", "scale", "better", "meaning")
"""The fields of `Metric` in their order."""
_TRAINING = "spec"
"""The file of the settings that every run has."""


class _Sizes(NamedTuple):
    """What a file of sizes says of a game and a learner."""

    game: str
    learner: str
    values: Mapping[str, str]
    """By path, `training.train_env_steps`."""


def topics() -> list[Topic]:
    """Everything, kind by kind."""
    learners, games = vocabulary.algorithms(), vocabulary.environments()
    sections = [vocabulary.training(), *learners, *games]
    sizes, keys = list(_sizes(learners, games)), list(question_keys())
    ruled = [(game, sources.module(game.package, "rules")) for game in games]
    return [
        *chain.from_iterable(_algorithms(section, sizes) for section in learners),
        *chain.from_iterable(_games(*each, sizes) for each in ruled),
        *chain.from_iterable(_settings(each, sizes) for each in sections),
        *_channels(),
        *chain.from_iterable(_parts(*each) for each in vocabulary.PARTS.items()),
        *(metrics := [*chain.from_iterable(_metrics(*each) for each in ruled)]),
        *_logged({name for each in metrics for name in each.names}),
        *asked_topics(keys),
        Topic("file", ("toml",), "a question with every key", question_file(keys)),
        *map(_key, keys),
        *command_topics(),
        *word_topics(),
    ]


def _algorithms(section: Section, sizes: Sequence[_Sizes]) -> Iterator[Topic]:
    text = sources.module(section.package, section.module).docstring
    fitting = [
        Fact(f"in {each.game}", _pairs(each.values))
        for each in sizes
        if each.learner == section.module
    ]
    for named in section.named:
        changes = dict(named.changes)
        where = f"{section.module}.py with {_pairs(changes) or 'its defaults'}"
        facts = (*_values(section, changes), *fitting)
        yield Topic("algorithm", (named.name,), where, text, facts)


def _games(section: Section, rules: Module, sizes: Sequence[_Sizes]) -> Iterator[Topic]:
    metrics = [Fact(name, _formula(each)) for name, each in vocabulary.metrics(rules).items()]
    for named in section.named:
        changes = dict(named.changes)
        where = f"{_game(section)} with {_pairs(changes) or 'its defaults'}"
        fitting = [
            Fact(f"for {each.learner}", _pairs(each.values))
            for each in sizes
            if each.game == named.name
        ]
        facts = (*_values(section, changes), *metrics, *fitting)
        yield Topic("game", (named.name,), where, rules.docstring, facts)


def _settings(section: Section, sizes: Sequence[_Sizes]) -> Iterator[Topic]:
    of = f"of {', '.join(section.names) or 'every run'}"
    for setting in section.settings:
        path = f"{section.name}.{setting.key}"
        facts = [Fact("default", setting.default)]
        if setting.choices:
            facts.append(Fact("one of", ", ".join(setting.choices)))
        for named in section.named:
            facts += [Fact(named.name, value) for key, value in named.changes if key == setting.key]
        for each in sizes:
            if path in each.values and section.module in (each.learner, _TRAINING):
                facts.append(Fact(f"{each.learner} in {each.game}", each.values[path]))
        yield Topic("setting", (path,), of, setting.said, tuple(facts))
    if not section.named:
        yield Topic("settings", (section.name,), of, "", tuple(_values(section, {})))


def _channels() -> Iterator[Topic]:
    for module in sources.modules(_CHANNELS):
        made, kind = module.name.title().replace("_", ""), module.name.replace("_", "-")
        settings = list(sources.settings(module.tree, made))
        typed = f"{kind}{':' * bool(settings)}{','.join(each.key.upper() for each in settings)}"
        text = f"{module.docstring}\n\n{sources.class_docstring(module.tree, made)}"
        facts = tuple(Fact(each.key.upper(), each.said) for each in settings)
        yield Topic("channel", (kind,), f"--channel {typed}", text, facts)
    for word, share in WORDS.items():
        channel = Channel(LINKS, (share,))
        yield Topic("channel", (word,), f"--channel {channel.key}", sentence(channel.label))
    for name, key in NAMED.items():
        yield Topic("channel", (name,), f"--channel {key}", "A channel with a name of its own.")


def _parts(setting: str, package: str) -> Iterator[Topic]:
    """What a setting of learners that is a file's name can be."""
    for module in sources.modules(package):
        where = f"--set algorithm.{setting}={module.name}"
        yield Topic(setting, (module.name,), where, module.docstring)


def _metrics(section: Section, rules: Module) -> Iterator[Topic]:
    for name, formula in vocabulary.metrics(rules).items():
        yield Topic("metric", (name,), f"of {_game(section)}", _formula(formula))


def _logged(known: Set[str]) -> Iterator[Topic]:
    """What else stands in logs: the page says it."""
    for first, meaning in rows(page(METRICS)):
        for name in re.findall("`([^`]+)`", first):
            if name not in known:
                yield Topic("metric", (name,), "in logs and tables", sentence(meaning))


def _key(key: Key) -> Topic:
    text = f"{key.meaning}\n\n{key.example if key.is_table else f'{key.names[0]} = {key.example}'}"
    return Topic("key", key.paths, "in a question's file (msgdrop explain toml)", text)


def _sizes(learners: Sequence[Section], games: Sequence[Section]) -> Iterator[_Sizes]:
    """The paper's, then those of games, then of learners.

    What is wrong with one is told who wants to train with it.
    """
    theirs = (sources.texts(game.package, "sizes.toml").values() for game in games)
    for text in (shipped_file(PAPER).decode(), *chain.from_iterable(theirs)):
        with suppress(ValueError, AttributeError):  # no TOML, or no tables
            for game, found in tomllib.loads(text).items():
                yield from (_sized(game, learner, each) for learner, each in found.items())
    for section in learners:
        own = sources.tables(sources.module(section.package, section.module).tree.body, "SIZES")
        with suppress(AttributeError):
            yield from (_sized(game, section.module, each) for game, each in own.items())


def _sized(game: str, learner: str, tables: Mapping[str, Mapping[str, object]]) -> _Sizes:
    pairs = ((name, *pair) for name, table in tables.items() for pair in table.items())
    return _Sizes(game, learner, {f"{name}.{key}": notation(value) for name, key, value in pairs})


def _values(section: Section, changes: Mapping[str, str]) -> list[Fact]:
    """A section's settings as a name has them."""
    return [Fact(s.key, changes.get(s.key, s.default), s.said) for s in section.settings]


def _formula(call: ast.expr) -> str:
    """What `Metric("catches", "steps", 500.0, "higher", "evader catches")` says."""
    if not isinstance(call, ast.Call):
        return ast.unparse(call)
    values = dict(zip(_METRIC, map(sources.literal, call.args), strict=False))
    metric = values | dict(sources.arguments(call))
    scale = str(metric.get("scale")).removesuffix(".0")
    ratio = f"{scale} x {metric.get('count')} / {metric.get('per')}".removeprefix("1 x ")
    return f"{metric.get('meaning')} ({ratio}; {metric.get('better')} is better)"


def _game(section: Section) -> str:
    return section.package.rpartition(".")[2]


def _pairs(values: Mapping[str, str]) -> str:
    return ", ".join(f"{path.rpartition('.')[2]}={value}" for path, value in values.items())
