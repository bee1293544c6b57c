"""The paper on one page, claim by claim: as HTML that needs nothing else, as Markdown, as JSON."""
