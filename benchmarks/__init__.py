"""What it costs, against what: `python -m benchmarks.throughput`."""
