"""What `--set` and `--reading` take: in a command's help; settings in full with `--set help`."""

from typing import Any

from typer.core import TyperCommand

from msgdrop_cli.commands.parts import console, sources, vocabulary
from msgdrop_cli.commands.parts.options import TrainOptions, check_device_plays
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.readings import all_readings
from msgdrop_cli.definition.spec import Definition

HELP = "help"
"""As in `--set help`."""


class ListsSettings(TyperCommand):
    """A command whose help ends with the settings that `--set` takes."""

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the examples, then every setting with its default, learner by learner."""
        super().format_epilog(ctx, formatter)
        rows = []
        for each in vocabulary.sections():
            whose = f"{', '.join(each.names)}: " if each.names else ""
            pairs = ", ".join(f"{s.key}={s.default.replace(' ', '')}" for s in each.settings)
            rows.append((f"{each.name}.", f"{whose}{pairs}"))
        with formatter.section("What --set takes (what it means, and its value here: --set help)"):
            formatter.write_dl(rows)


class ListsReadings(TyperCommand):
    """A command whose help ends with the readings that `--reading` takes."""

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the examples, then every reading with what it says."""
        super().format_epilog(ctx, formatter)
        with formatter.section("What --reading takes (why, and what else is open: PAPER.md)"):
            formatter.write_dl([(name, each.says) for name, each in all_readings().items()])


def check(definition: Definition, options: TrainOptions) -> None:
    """Refuse (DefinitionError) mistyped names and settings before torch is loaded.

    And games of other people on a GPU.
    """
    from msgdrop_cli.commands.parts.early import check_early

    check_early(
        definition,
        options.profile,
        overrides=[each for each in options.overrides if each != HELP],
        readings=options.readings,
    )
    check_device_plays(definition.games(options.profile), options.device)


def show_settings(definition: Definition, options: TrainOptions, *, as_json: bool) -> int:
    """Show every setting with its meaning and its value in the first run; loads torch.

    Returns the exit code, 0.
    """
    from msgdrop_cli.engine.offers import catalogue

    others = [each for each in options.overrides if each != HELP]
    profile, readings = options.profile, options.readings
    run = plan(definition, profile, catalogue(), overrides=others, readings=readings).runs[0]
    spec = run.spec
    configs = {
        "training": spec.training,
        "algorithm": spec.algorithm_config,
        "environment": spec.environment_config,
    }
    algorithm = str(definition.variants[run.variant].algorithm["name"])
    rows = [
        (f"{section.name}.{s.key}", getattr(configs[section.name], s.key), s.meaning)
        for section in vocabulary.sections(definition.games(profile)[0], algorithm)
        for s in section.settings
    ]
    if as_json:
        names = ("setting", "value", "meaning")
        console.result_json([dict(zip(names, row, strict=True)) for row in rows])
        return 0
    console.note(f"as {run.label} on {spec.environment} has them, profile {run.profile}\n")
    said = {f"{path}={sources.notation(value)}": meaning for path, value, meaning in rows}
    console.facts(said, is_result=True)
    return 0
