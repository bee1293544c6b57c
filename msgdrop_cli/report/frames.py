"""`msgdrop_cli.results` and `.curves`: records in Python, as pandas frames if pandas is there.

docs/exports.md has an example, which is a test.
"""

from os import PathLike
from pathlib import Path
from typing import Any

from msgdrop_cli.records.elsewhere import runs_of
from msgdrop_cli.records.remembering import remembering
from msgdrop_cli.report.tidy import Columns, curves_table, results_table
from msgdrop_cli.report.write import home_of


def results(folder: str | PathLike[str] = "results") -> Any:
    """A row for each run in or below a folder and each channel that it was evaluated through.

    Columns: run_id, question, variant, label, environment, profile, seed, status, reason,
    train_env_steps, env_steps, overrides, registration, commit, machine, device, threads, kernel,
    torch, created, wall_time_s, path, channel, episodes, then every metric (docs/metrics.md) over
    all of these episodes. A pandas.DataFrame if pandas is installed, else a dict of lists. Raises
    RecordError: no such folder, no run in it, or a damaged record.
    """
    records = remembering(runs_of(Path(folder)).records, home_of(Path(folder)))
    return _framed(results_table(records))


def curves(folder: str | PathLike[str] = "results") -> Any:
    """A row for each run in or below a folder and each window of its training, as in its log.

    Columns: run_id, question, variant, label, environment, profile, seed, env_steps (at the
    window's end), then what the log has: metrics of the exploring policy in that window, loss,
    epsilon. Frames and errors as of `results`.
    """
    return _framed(curves_table(runs_of(Path(folder)).records))


def _framed(columns: Columns) -> Any:
    try:
        from pandas import DataFrame
    except ImportError:
        return columns
    return DataFrame(columns)
