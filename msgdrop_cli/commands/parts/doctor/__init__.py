"""What `msgdrop doctor` looks at: a file for each group of checks, all of them in `CHECKS`.

A check changes nothing that stays, says in a line what it found, and in another how to mend it.
"""
