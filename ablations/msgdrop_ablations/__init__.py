"""One TOML file per question: what is compared, at which scales, and what the paper claims."""
