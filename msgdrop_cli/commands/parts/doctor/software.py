"""Python, the libraries, and what they compute with."""

import re
import shutil
import sys
from importlib import metadata
from pathlib import Path

from msgdrop_cli.commands.parts.doctor.check import Check, Found, fine, mend, note

_CHECKOUT = Path(__file__).parents[4]
_RANGE = re.compile(r"([A-Za-z0-9._-]+)\s*((?:[<>=!~]=?[0-9.]+,?)*)")
_OLDEST, _NEWEST = (3, 11), (3, 14)


def _python(_: Path) -> Found:
    version = ".".join(map(str, sys.version_info[:3]))
    if not _OLDEST <= sys.version_info[:2] < _NEWEST:
        return mend(f"{version}, tested with 3.11 to 3.13", "make distclean demo PYTHON=python3.12")
    return fine(version)


def _libraries(_: Path) -> Found:
    """Whether each library lies in the range that is asked for."""
    try:
        asked = metadata.requires("msgdrop") or []
    except metadata.PackageNotFoundError:
        return note("msgdrop itself is not installed: run from its sources", "pip install -e .")
    odd = []
    for requirement in asked:
        match = _RANGE.match(requirement)
        if match is None or "extra ==" in requirement:
            continue
        name, bounds = match[1], match[2]
        try:
            version = metadata.version(name)
        except metadata.PackageNotFoundError:
            odd.append(f"{name} is missing")
            continue
        if not _within(version, bounds):
            odd.append(f"{name} {version} is not {bounds}")
    if odd:
        return mend("; ".join(odd), "pip install -c constraints.txt -e .")
    return fine("all in their ranges")


def _constraints(_: Path) -> Found:
    """Whether the versions are those that the published numbers were tested with."""
    file = _CHECKOUT / "constraints.txt"
    if not file.is_file():
        return fine("no constraints.txt beside the program")
    odd = []
    for name in ("torch", "numpy", "joblib", "safetensors", "typer", "rich", "matplotlib"):
        pinned = re.search(rf"^{name}==(\S+)", file.read_text(), re.MULTILINE)
        found = metadata.version(name).split("+")[0]
        if pinned and pinned[1] != found:
            odd.append(f"{name} {found} (pinned: {pinned[1]})")
    if odd:
        return note(
            f"{'; '.join(odd)}: last bits may differ", "pip install -c constraints.txt -e ."
        )
    return fine("as in constraints.txt")


def _torch(_: Path) -> Found:
    import torch

    return fine(f"{torch.__version__}, {torch.backends.cpu.get_cpu_capability()}")


def _threads(_: Path) -> Found:
    """Runs compute on one thread; only what runs beside them can disturb that."""
    import torch

    from msgdrop_cli.engine.arithmetic import THREADS, settled

    with settled():
        found = torch.get_num_threads()
    if found != THREADS:
        return mend(f"torch takes {found}, runs need {THREADS}", "unset OMP_NUM_THREADS")
    return fine(f"{found} a run")


def _gpu(_: Path) -> Found:
    import torch

    if not torch.cuda.is_available():
        return fine("none: everything is computed by the processor")
    return fine(f"{torch.cuda.get_device_name()}, for --device cuda")


def _compiler(_: Path) -> Found:
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return note("none: updates are several times slower", "install gcc or clang")
    return fine(compiler)


def _kernels(_: Path) -> Found:
    from msgdrop_cli.kernels.build import why_torch

    if reason := why_torch():
        return note(f"not built: {reason}; updates are several times slower", _compiles(reason))
    return fine("built and loaded")


def _compiles(reason: str) -> str:
    if reason.startswith("MSGDROP_KERNEL"):
        return "unset MSGDROP_KERNEL"
    return "install gcc or clang, and see that its cache folder can be written and executed from"


def _agreement(_: Path) -> Found:
    """The kernels give what torch gives: Q of new networks for some games, and random numbers."""
    import torch

    from msgdrop_cli.algorithms.dcc import DCC, Config
    from msgdrop_cli.engine.arithmetic import settled
    from msgdrop_cli.engine.offers import catalogue
    from msgdrop_envs import registry

    env = registry.make(catalogue().environment("pursuit-n6"), "cpu")
    with settled():
        learner = DCC([Config(rate=0.5)], env)
        generator = torch.Generator().manual_seed(1)
        learner.initialise(torch.rand(1, learner.init_uniforms, generator=generator))
        obs = torch.randint(0, 2, (1, 4, env.agents, env.observation_size), generator=generator)
        obs = obs.to(env.observation_dtype)
        factor = learner.scale.expand(-1, 4, -1, -1)
        expected = learner.q_values(obs, None, factor, learner.shown_agents)
        found = learner.q_exec(obs).transpose(1, 2).reshape(expected.shape)
    worst = float((found - expected).abs().max())
    if not worst < 1e-4:
        return mend(f"they differ from torch by {worst:g}", "export MSGDROP_KERNEL=torch")
    return fine(f"within {worst:.0e} of torch")


def _commit(_: Path) -> Found:
    from msgdrop_cli.engine.facts import commit

    known = commit()
    if known is None:
        return note("unknown: records will not name it", "export MSGDROP_COMMIT=<40 hex digits>")
    if known.endswith("+"):
        return note(f"{known[:12]} and changes: records will say +", "commit before you publish")
    return fine(known[:12])


def _within(version: str, bounds: str) -> bool:
    """Whether a version satisfies bounds such as `>=2.10,<3`; what cannot be read does."""
    for sign, bound in re.findall(r"([<>]=?)([0-9.]+)", bounds):
        mine, other = _numbers(version), _numbers(bound)
        if (sign == ">=" and mine < other) or (sign == "<" and mine >= other):
            return False
    return True


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", version.split("+")[0])[:3]))


CHECKS = (
    Check(name="Python", look=_python),
    Check(name="libraries", look=_libraries),
    Check(name="constraints", look=_constraints),
    Check(name="torch", look=_torch),
    Check(name="threads", look=_threads),
    Check(name="GPU", look=_gpu),
    Check(name="C compiler", look=_compiler),
    Check(name="kernels", look=_kernels),
    Check(name="kernels agree", look=_agreement),
    Check(name="commit", look=_commit),
)
