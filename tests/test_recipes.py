"""What README says of adding a thing is what happens."""

import re
from pathlib import Path

from msgdrop_cli.algorithms.discovery import learner_class, learners
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine.offers import catalogue

README = (Path(__file__).resolve().parents[1] / "README.md").read_text()


def test_the_recipe_of_a_question_is_one(tmp_path: Path) -> None:
    """Saved as it stands there it plans four runs, of two different settings."""
    [text] = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    (tmp_path / "mine.toml").write_text(text)
    asked = plan(load_definition(str(tmp_path / "mine.toml")), "quick", catalogue())
    assert len({run.run_id for run in asked.runs}) == 4
    rates = {run.variant: run.spec.algorithm_config.rate for run in asked.runs}
    assert rates == {"dcc": 0.0, "md-0.05": 0.05}


def test_a_learner_is_what_its_recipe_says() -> None:
    """A file with Config and NAMED, and a class called like it in capitals."""
    for name, module in learners().items():
        assert learner_class(name) is getattr(module, name.upper())
        assert module.NAMED
        assert module.Config()
