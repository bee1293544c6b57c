"""Update rules, one file each. A learner holds the stacked networks of a cohort's runs."""
