"""`msgdrop doctor`: whether everything works here, and how to mend what does not."""

from pathlib import Path

import typer

from msgdrop_cli.commands.parts import console, options
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.strict import one_line

app = typer.Typer()
_SOMETHING_TO_MEND = 78


@app.command(epilog=options.examples("doctor", "doctor --results /scratch/me/results --json"))
def doctor(results: options.Results = Path("results"), json: options.Json = False) -> int:
    """Look whether everything works here, and say how to mend what does not.

    Ends with 0 if all runs can be trained, 78 if something is to be mended. Nothing is changed.
    """
    from msgdrop_cli.commands.parts.doctor import folders, machine, software, workers

    last = workers.start()
    checks = (*machine.CHECKS, *folders.CHECKS, *software.CHECKS, last)
    found = {check.name: check(results) for check in checks}
    if json:
        console.result_json(
            [
                {"check": name, "state": each.state, "found": one_line(each.words), "fix": each.fix}
                for name, each in found.items()
            ]
        )
    else:
        rows = {}
        for name, each in found.items():
            fix = f"\n      {each.fix}" if each.fix else ""
            rows[name] = f"{each.state}  {one_line(each.words)}{fix}"
        console.facts(rows, is_result=True)
    bad = sum(each.state == "mend" for each in found.values())
    notes = sum(each.state == "note" for each in found.values())
    if not json:
        counts = f"{several(bad, 'fault')} to mend, {several(notes, 'note')}"
        console.result(f"\n{len(found)} checks: {counts}" if bad or notes else "\nall is fine")
    return _SOMETHING_TO_MEND if bad else 0
