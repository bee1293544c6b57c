"""What the repository's pages say of the published studies, written from their records.

    make readme            # or: python -m benchmarks.readme

A marked block, `<!-- records: pursuit-table -->` to `<!-- end -->`, also within a line (not at its
begin, where Markdown ends a paragraph), holds what the function of that name gives: words with
numbers in them, plain f-strings. A word that depends on a verdict is checked there (`expect`): if
the records say otherwise, the sentence has to be written anew. What would have to be played again
stands in `<!-- played: ... -->`, and `PLAYED` says how. It is a maintainer's tool, and so no part
of the product. Speeds come from benchmarks/NOTES.md, not from here, and what a prototype without
records once gave is typed.
"""
